// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/matches.hpp"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/json_text.hpp"
#include "base/read_whole.hpp"
#include "cairn/atomic_file.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

constexpr const char* kKind = "cairn loops";
constexpr int kFormat = 1;

template <class Matrix>
Json rows_of(const Matrix& matrix) {
  Json numbers = Json::array();
  for (Eigen::Index r = 0; r < matrix.rows(); ++r)
    for (Eigen::Index c = 0; c < matrix.cols(); ++c) numbers.push_back(matrix(r, c));
  return numbers;
}

template <class Matrix>
Matrix matrix_of(const Json& numbers) {
  Matrix matrix;
  if (!numbers.is_array() || numbers.size() != static_cast<std::size_t>(matrix.size()))
    throw std::runtime_error("a matrix is incomplete");
  for (Eigen::Index i = 0; i < matrix.size(); ++i)
    matrix(i / matrix.cols(), i % matrix.cols()) = numbers[static_cast<std::size_t>(i)].get<double>();
  if (!matrix.allFinite()) throw std::runtime_error("a number is missing");
  return matrix;
}

Json json_of(const Loop& loop) {
  return {{"from", loop.edge.i},
          {"to", loop.edge.j},
          {"from_to", rows_of(loop.edge.i_from_j.matrix().topRows<3>())},
          {"information", rows_of(loop.edge.information)},
          {"corners", loop.corners},
          {"inlier_share", loop.inlier_share},
          {"rmse", loop.rmse}};
}

Loop loop_of(const Json& json) {
  constexpr double kRigid = 1e-6;
  Loop loop{.edge = {.i = json.at("from"), .j = json.at("to"), .is_loop_closure = true},
            .corners = json.at("corners"),
            .inlier_share = json.at("inlier_share"),
            .rmse = json.at("rmse")};
  loop.edge.i_from_j.affine() = matrix_of<Eigen::Matrix<double, 3, 4>>(json.at("from_to"));
  const Eigen::Matrix3d turn = loop.edge.i_from_j.linear();
  if (!(turn.transpose() * turn).isIdentity(kRigid) || turn.determinant() < 0)
    throw std::runtime_error("a pose is none");
  loop.edge.information = matrix_of<Matrix6d>(json.at("information"));
  if (loop.edge.information.llt().info() != Eigen::Success)
    throw std::runtime_error("an information matrix is not positive definite");
  return loop;
}

}  // namespace

std::string map_id(const Atlas& atlas) {
  boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~0ull, ~0ull, true, true> sum;  // ECMA-182
  for (const Keyframe& keyframe : atlas.keyframes) {
    const Eigen::Matrix4d& pose = keyframe.odometry_from_camera.matrix();
    sum.process_bytes(&keyframe.timestamp, sizeof keyframe.timestamp);
    sum.process_bytes(pose.data(), sizeof(double) * 16);
  }
  return fmt::format("{:016x}", sum.checksum());
}

void write_matches(const std::filesystem::path& file, const Matches& matches) {
  Json loops = Json::array();
  for (const Loop& loop : matches.loops) loops.push_back(json_of(loop));
  write_whole(file, text_of({{"kind", kKind},
                             {"format", kFormat},
                             {"maps", {matches.first, matches.second}},
                             {"loops", std::move(loops)}},
                            1) +
                        '\n');
}

Matches read_matches(const std::filesystem::path& file, std::size_t first_keyframes, std::size_t second_keyframes) {
  const char* const again = "make it again with cairn match";
  try {
    const auto bytes = read_whole(file);
    const Json json = Json::parse(bytes.begin(), bytes.end());
    if (json.at("kind") != kKind) throw std::runtime_error("holds no loops between maps");
    if (json.at("format") != kFormat) throw std::runtime_error("was written by another version of Cairn");
    Matches matches{.first = json.at("maps").at(0), .second = json.at("maps").at(1), .loops = {}};
    for (const Json& loop : json.at("loops")) {
      matches.loops.push_back(loop_of(loop));
      const PoseGraph::Edge& edge = matches.loops.back().edge;
      if (edge.i >= first_keyframes || edge.j >= second_keyframes)
        throw std::runtime_error("names a keyframe that its map has not");
    }
    return matches;
  } catch (const Json::exception& error) {
    throw std::runtime_error(fmt::format("{}: is damaged ({}); {}", file.string(), plain(error.what()), again));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}; {}", file.string(), error.what(), again));
  }
}

}  // namespace cairn
