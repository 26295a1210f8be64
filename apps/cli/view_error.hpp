// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <nlohmann/json.hpp>

#include "cairn/eval/evaluation.hpp"

namespace cairn::apps {

/// Fields of a comparison of rendered views, as `evaluate views` and `splat` print them.
inline nlohmann::json view_error_json(const ViewError& e) {
  return {{"psnr_db", e.psnr},
          {"psnr_with_gain_db", e.psnr_with_gain},
          {"covered", e.covered},
          {"depth_rmse_m", e.depth_rmse},
          {"frames", e.frames}};
}

}  // namespace cairn::apps
