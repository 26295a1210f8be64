// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <spdlog/spdlog.h>

#include <Eigen/Cholesky>

#include "cairn/mapping/pose_graph.hpp"
#include "fuzz.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  spdlog::set_level(spdlog::level::off);
  const auto file = fuzz::file_of("graph.g2o", fuzz::text_of(data, size));
  fuzz::expect_value_or_plain_error([&] {
    const PoseGraph graph = read_g2o(file);
    for (const auto& node : graph.world_from_node)
      if (!node.matrix().allFinite()) std::abort();
    for (const auto& edge : graph.edges) {
      if (edge.i >= graph.world_from_node.size() || edge.j >= graph.world_from_node.size()) std::abort();
      if (Eigen::LLT<Matrix6d>(edge.information).info() != Eigen::Success) std::abort();
    }
  });
  return 0;
}
