// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "multisession/segment_loops.hpp"

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/atomic_file.hpp"
#include "base/json_text.hpp"
#include "geometry/pose_checksum.hpp"
#include "session/json_file.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

constexpr JsonKind kLoops{"cairn loops", "is not a file of loops between maps", "make it again with cairn match"};

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
  if (!matrix.allFinite()) throw std::runtime_error("a number is not finite");
  return matrix;
}

Json json_of(const Loop& loop) {
  return {{"from", loop.edge.i},
          {"to", loop.edge.j},
          {"from_to", rows_of(loop.edge.i_from_j.matrix().topRows<3>())},
          {"information", rows_of(loop.edge.information)},
          {"corners", loop.feature_inliers},
          {"inlier_share", loop.inlier_share},
          {"rmse", loop.rmse}};
}

Loop loop_of(const Json& json) {
  constexpr double kRigid = 1e-6;
  Loop loop{.edge = {.i = json.at("from"), .j = json.at("to"), .is_loop_closure = true},
            .feature_inliers = json.at("corners"),
            .inlier_share = json.at("inlier_share"),
            .rmse = json.at("rmse")};
  loop.edge.i_from_j.affine() = matrix_of<Eigen::Matrix<double, 3, 4>>(json.at("from_to"));
  const Eigen::Matrix3d turn = loop.edge.i_from_j.linear();
  if (!(turn.transpose() * turn).isIdentity(kRigid) || turn.determinant() < 0)
    throw std::runtime_error("a pose is not a rigid transform");
  loop.edge.information = matrix_of<Matrix6d>(json.at("information"));
  if (loop.edge.information.llt().info() != Eigen::Success)
    throw std::runtime_error("an information matrix is not positive definite");
  return loop;
}

}  // namespace

std::string map_id(const Atlas& atlas) {
  PoseChecksum sum;
  for (const Keyframe& keyframe : atlas.keyframes) {
    sum.add(keyframe.timestamp);
    sum.add(keyframe.odometry_from_camera);
  }
  return sum.text();
}

void write_matches(const std::filesystem::path& file, const Matches& matches) {
  Json loops = Json::array();
  for (const Loop& loop : matches.loops) loops.push_back(json_of(loop));
  write_whole(file, text_of({{"kind", kLoops.kind},
                             {"format", kLoops.format},
                             {"maps", {matches.first, matches.second}},
                             {"loops", std::move(loops)}},
                            1) +
                        '\n');
}

Matches read_matches(const std::filesystem::path& file, std::size_t first_keyframes, std::size_t second_keyframes) {
  return read_json_file(file, kLoops, [&](const Json& json) {
    Matches matches{.first = json.at("maps").at(0), .second = json.at("maps").at(1), .loops = {}};
    for (const Json& loop : json.at("loops")) {
      matches.loops.push_back(loop_of(loop));
      const PoseGraph::Edge& edge = matches.loops.back().edge;
      if (edge.i >= first_keyframes || edge.j >= second_keyframes)
        throw std::runtime_error("refers to a missing keyframe");
    }
    return matches;
  });
}

}  // namespace cairn
