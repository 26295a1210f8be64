// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <cmath>
#include <fstream>
#include <map>
#include <stdexcept>
#include <string_view>

#include "base/atomic_file.hpp"
#include "base/lines.hpp"
#include "base/words.hpp"
#include "cairn/mapping/pose_graph.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// g2o's order is (translation, rotation).
int g2o_index(int i) { return (i + 3) % 6; }

/// First line of files with information of half the angle; g2o ignores this line.
constexpr std::string_view kHalfAngle =
    "# cairn: information of rotations is of the quaternion's vector part, half the angle";

/// Converts information in radians to half the angle (`rotation_scale` 2), or back (`rotation_scale` 0.5).
Matrix6d rescaled(const Matrix6d& information, double rotation_scale) {
  Vector6d scale = Vector6d::Ones();
  scale.head<3>().setConstant(rotation_scale);
  return scale.asDiagonal() * information * scale.asDiagonal();
}

bool has_half_angles(const fs::path& file) {
  std::ifstream in(file);
  std::string line;
  return std::getline(in, line) && line.starts_with(kHalfAngle);
}

/// Minimum information: as a share of the largest eigenvalue, and absolute (1/rad^2, 1/m^2).
constexpr double kMinEigenvalueShare = 1e-9, kMinEigenvalue = 1e-12;

/// Published graphs contain matrices with negative eigenvalues from estimates. These directions were not measured:
/// their eigenvalues are clamped to nearly zero. Returns true if the matrix was indefinite; other matrices stay
/// unchanged.
bool make_positive_definite(Matrix6d& information) {
  if (Eigen::LLT<Matrix6d>(information).info() == Eigen::Success) return false;
  const Eigen::SelfAdjointEigenSolver<Matrix6d> eigen(information);
  const double min_eigenvalue = std::max(kMinEigenvalue, kMinEigenvalueShare * eigen.eigenvalues().maxCoeff());
  const Matrix6d clamped = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(min_eigenvalue).asDiagonal() *
                           eigen.eigenvectors().transpose();
  information = 0.5 * (clamped + clamped.transpose());
  return true;
}

struct ReadEdge {
  long from, to;
  int line;
  PoseGraph::Edge edge;
};

/// Line of a file, split into words.
struct Line {
  const fs::path& file;
  int number;
  const std::vector<std::string>& words;

  [[nodiscard]] std::runtime_error error(const std::string& what) const {
    return std::runtime_error(fmt::format("{}:{}: {}", file.string(), number, what));
  }
  [[nodiscard]] double value(std::size_t i) const { return number_of(words[i], file, number); }
  [[nodiscard]] long id(std::size_t i) const {
    const double v = value(i);
    if (v != std::floor(v) || std::abs(v) > 1e15) throw error("'" + shown(words[i]) + "' is not a node id");
    return std::lround(v);
  }
  /// Reads seven words.
  [[nodiscard]] Eigen::Isometry3d pose(std::size_t i) const {
    const Eigen::Quaterniond q(value(i + 6), value(i + 3), value(i + 4), value(i + 5));
    if (!is_rotation(q)) throw error("the quaternion is zero or too large");
    Eigen::Isometry3d t = Eigen::Isometry3d::Identity();
    t.linear() = q.normalized().toRotationMatrix();
    t.translation() = Eigen::Vector3d(value(i), value(i + 1), value(i + 2));
    return t;
  }
  [[nodiscard]] ReadEdge edge() const {
    if (words.size() != 31)
      throw error("expected `EDGE_SE3:QUAT from to x y z qx qy qz qw` and 21 numbers of the information matrix");
    ReadEdge read{.from = id(1), .to = id(2), .line = number, .edge = {.i_from_j = pose(3)}};
    Matrix6d& information = read.edge.information;
    std::size_t next = 10;
    for (int r = 0; r < 6; ++r)
      for (int c = r; c < 6; ++c)
        information(g2o_index(r), g2o_index(c)) = information(g2o_index(c), g2o_index(r)) = value(next++);
    if (!(information.cwiseAbs().maxCoeff() < 1e100)) throw error("the information matrix is too large");
    return read;
  }
};

/// Graph with nodes numbered in the order of their ids.
PoseGraph numbered(const std::map<long, Eigen::Isometry3d>& nodes, const std::vector<ReadEdge>& edges,
                   const fs::path& file) {
  PoseGraph graph;
  std::map<long, std::size_t> index;
  for (const auto& [id, pose] : nodes) {
    index[id] = graph.world_from_node.size();
    graph.world_from_node.push_back(pose);
  }
  for (const ReadEdge& read : edges) {
    for (const long id : {read.from, read.to})
      if (!index.contains(id))
        throw std::runtime_error(fmt::format("{}:{}: unknown node {}", file.string(), read.line, id));
    PoseGraph::Edge& edge = graph.edges.emplace_back(read.edge);
    edge.i = index[read.from];
    edge.j = index[read.to];
    edge.is_loop_closure = std::abs(read.to - read.from) != 1;
  }
  return graph;
}

}  // namespace

PoseGraph read_g2o(const fs::path& file) {
  std::map<long, Eigen::Isometry3d> nodes;
  std::vector<ReadEdge> edges;
  std::size_t indefinite = 0;
  for_each_line(file, [&](int number, const std::vector<std::string>& words) {
    const Line line{file, number, words};
    if (words[0] == "VERTEX_SE3:QUAT") {
      if (words.size() != 9) throw line.error("expected `VERTEX_SE3:QUAT id x y z qx qy qz qw`");
      if (!nodes.emplace(line.id(1), line.pose(2)).second) throw line.error("duplicate node " + shown(words[1]));
    } else if (words[0] == "EDGE_SE3:QUAT") {
      indefinite += make_positive_definite(edges.emplace_back(line.edge()).edge.information);
    } else if (words[0] != "FIX") {
      throw line.error("unknown record '" + shown(words[0]) + "'; supported: VERTEX_SE3:QUAT, EDGE_SE3:QUAT, FIX");
    }
  });
  if (nodes.empty()) throw std::runtime_error(file.string() + ": has no VERTEX_SE3:QUAT");
  if (indefinite > 0)
    spdlog::warn(
        fmt::format("{}: {} of {} edges have an information matrix that is not positive definite; directions "
                    "without positive information are ignored",
                    file.string(), indefinite, edges.size()));
  PoseGraph graph = numbered(nodes, edges, file);
  if (has_half_angles(file)) {
    graph.file_rotation = PoseGraph::FileRotation::half_angle;
    for (PoseGraph::Edge& edge : graph.edges) edge.information = rescaled(edge.information, 0.5);
  }
  return graph;
}

void write_g2o(const fs::path& file, const PoseGraph& graph) {
  write_whole(file, [&](std::ostream& out) {
    const auto pose = [](const Eigen::Isometry3d& t) {
      const Eigen::Quaterniond q(t.linear());
      return fmt::format("{:.9g} {:.9g} {:.9g} {:.12g} {:.12g} {:.12g} {:.12g}", t.translation().x(),
                         t.translation().y(), t.translation().z(), q.x(), q.y(), q.z(), q.w());
    };
    const bool has_half_angle = graph.file_rotation == PoseGraph::FileRotation::half_angle;
    if (has_half_angle) out << kHalfAngle << '\n';
    for (std::size_t i = 0; i < graph.world_from_node.size(); ++i)
      out << fmt::format("VERTEX_SE3:QUAT {} {}\n", i, pose(graph.world_from_node[i]));
    for (const auto& edge : graph.edges) {
      out << fmt::format("EDGE_SE3:QUAT {} {} {}", edge.i, edge.j, pose(edge.i_from_j));
      const Matrix6d information = has_half_angle ? rescaled(edge.information, 2) : edge.information;
      for (int r = 0; r < 6; ++r)
        for (int c = r; c < 6; ++c) out << fmt::format(" {:.9g}", information(g2o_index(r), g2o_index(c)));
      out << '\n';
    }
  });
}

}  // namespace cairn
