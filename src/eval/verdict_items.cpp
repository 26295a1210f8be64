// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "eval/verdict_items.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace cairn {
namespace {

using Item = Verdict::Item;
using Level = Verdict::Level;

constexpr double kDegrees = 180 / std::numbers::pi;
// Percent of the measured depth, without edges; docs/decisions-tracking.md has the values of correct and wrong maps.
constexpr double kMaxInFront = 2, kMaxMissing = 8, kMaxNotPredicted = 15;
constexpr double kMinPoints = 2000;     // minimum number of measurements for a percentage
constexpr double kMaxBeyondDrift = 20;  // percent of the windows
constexpr int kMinWindows = 5;          // minimum number for a ratio of lengths

/// Item of the verdict: good or weak.
Item item(std::string name, double value, double limit, std::string unit, bool is_good, std::string text) {
  return {.name = std::move(name),
          .value = value,
          .limit = limit,
          .unit = std::move(unit),
          .level = is_good ? Level::good : Level::weak,
          .text = std::move(text)};
}

void add_turntable(std::vector<Item>& items, const StillView& s) {
  if (s.pairs == 0) return;
  const double moved = s.is_turntable() ? 100 * s.moved : 0;
  items.push_back(
      item("view_moves_before_still_camera", moved, 0, "%", moved == 0,
           moved == 0
               ? "the view moves with the camera"
               : fmt::format(
                     "the camera did not move, but {:.0f} % of the view did: for an object on a turntable, remove the "
                     "background (surface.max_depth or a mask)",
                     std::max(1.0, moved))));
}

void add_agreement(std::vector<Item>& items, const DepthAgreement& fused, const DepthAgreement& held_out) {
  if (fused.points >= kMinPoints) {
    const double front = 100 * fused.in_front, missing = 100 * fused.missing;
    items.push_back(
        item("map_in_the_way", front, kMaxInFront, "%", front <= kMaxInFront,
             fmt::format("{:.1f} % of the measured depth is behind a surface of the map{}", front,
                         front <= kMaxInFront ? ""
                                              : ": something moved, or a surface was reconstructed twice; record again "
                                                "without moving objects, and return to the start")));
    items.push_back(item(
        "measured_not_in_map", missing, kMaxMissing, "%", missing <= kMaxMissing,
        fmt::format(
            "{:.1f} % of the measured depth has no map surface nearby{}", missing,
            missing <= kMaxMissing ? "" : ": something moved, or the poses or the camera's intrinsics are wrong")));
    items.push_back(item("depth_rmse", 1000 * fused.rmse, 0, "mm", true,
                         fmt::format("measured depth differs from the map by {:.1f} mm (RMSE) and {:.1f} mm (median)",
                                     1000 * fused.rmse, 1000 * fused.median)));
  }
  if (held_out.points >= kMinPoints) {
    const double missing = 100 * held_out.missing;
    items.push_back(item("held_out_not_predicted", missing, kMaxNotPredicted, "%", missing <= kMaxNotPredicted,
                         fmt::format("{:.1f} % of the depth of held-out frames has no map surface nearby{}", missing,
                                     missing <= kMaxNotPredicted ? "" : ": the map does not predict them")));
  }
}

void add_speeds(std::vector<Item>& items, const Speeds& speeds) {
  if (!speeds.has_steps()) return;
  const auto add = [&](const char* name, const Speeds::Peak& peak, double limit, double scale, const char* unit,
                       const char* verb) {
    const bool is_good = peak.value <= limit;
    items.push_back(
        item(name, scale * peak.value, scale * limit, unit, is_good,
             fmt::format("the camera {} at up to {:.{}f} {}{}", verb, scale * peak.value, scale > 1 ? 0 : 1, unit,
                         is_good ? ""
                                 : fmt::format(", first at {:.2f} s: too fast for a hand-held camera; tracking failed "
                                               "there, or the timestamps are wrong (--motion for other carriers)",
                                               peak.timestamp))));
  };
  add("speed", speeds.speed(), speeds.speed_limit(), 1, "m/s", "moves");
  add("turn", speeds.turn(), speeds.turn_limit(), kDegrees, "degrees/s", "turns");
}

void add_device(std::vector<Item>& items, const PoseAgreement& d) {
  if (d.windows > 0) {
    const double beyond = 100 * d.beyond;
    const bool is_good = beyond <= kMaxBeyondDrift && d.shift <= d.allowed_shift && d.turn <= d.allowed_turn;
    items.push_back(
        item("device_poses", beyond, kMaxBeyondDrift, "%", is_good,
             fmt::format(
                 "the device's poses differ by more than drift in {:.0f} % of the windows of 1 and 5 s, and by {:.0f} "
                 "cm and {:.1f} degrees in total{}",
                 beyond, 100 * d.shift, kDegrees * d.turn,
                 is_good ? "" : ": one of the two is wrong; compare with --guess or --poses of the device")));
  }
  if (d.scaled_windows >= kMinWindows) {
    const double off = 100 * (d.scale - 1);
    const bool is_good = std::abs(d.scale - 1) <= std::max(d.allowed_scale, d.scale_spread);
    items.push_back(item(
        "device_scale", off, 100 * d.allowed_scale, "%", is_good,
        fmt::format("distances are {:.1f} % {} than in the device's poses{}", std::abs(off),
                    off < 0 ? "shorter" : "longer", is_good ? "" : ": check depth_scale and the camera's intrinsics")));
  }
}

}  // namespace

Item frames_item(double in_map, const RunSummary& o) {
  constexpr double kGood = 95, kBad = 80;
  const double value = 100 * in_map;
  Item i = item("frames_in_map", value, kGood, "%", value >= kGood,
                fmt::format("{} of {} frames are in the map", o.fused, o.total));
  if (value < kBad) i.level = Level::bad;
  return i;
}

std::vector<Item> items_of(const Measured& m) {
  std::vector<Item> items;
  add_turntable(items, m.still);
  add_agreement(items, m.fused, m.held_out);
  add_speeds(items, m.speeds);
  add_device(items, m.device);
  if (m.with_color) {
    const bool has_color = *m.with_color > 0;
    items.push_back(item("color", 100 * *m.with_color, 0, "%", has_color,
                         has_color ? fmt::format("{:.0f} % of the frames have color", 100 * *m.with_color)
                                   : "there is no color: tracking by depth alone fails at plain walls"));
  }
  const bool is_upright = m.upright_unknown.empty();
  items.push_back(item("upright", is_upright ? 1 : 0, 1, "", is_upright,
                       is_upright ? "the up axis is known" : "up axis " + m.upright_unknown));
  return items;
}

}  // namespace cairn
