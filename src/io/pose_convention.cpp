// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/io/pose_convention.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/words.hpp"

namespace cairn {
namespace {

/// Returns a unit vector by its name, x, -y and so on; zero for other names.
Eigen::Vector3d axis_of(std::string_view name) {
  double sign = 1;
  if (name.starts_with('-') || name.starts_with('+')) {
    if (name[0] == '-') sign = -1;
    name.remove_prefix(1);
  }
  const std::size_t i = std::string_view("xyz").find(name);
  return name.size() == 1 && i != std::string_view::npos
             ? Eigen::Vector3d(sign * Eigen::Vector3d::Unit(static_cast<int>(i)))
             : Eigen::Vector3d::Zero();
}

Eigen::Matrix3d axes_of(std::string_view right, std::string_view down, std::string_view forward) {
  Eigen::Matrix3d axes;
  axes << axis_of(right), axis_of(down), axis_of(forward);
  return axes;
}

struct NamedAxes {
  std::string_view name, right, down, forward;
};
constexpr std::array kAxes{NamedAxes{"opengl", "x", "-y", "-z"}, NamedAxes{"ros", "-y", "-z", "x"},
                           NamedAxes{"unity", "x", "-y", "z"}};
constexpr std::array<std::pair<std::string_view, double>, 4> kUnits{
    {{"mm", 0.001}, {"cm", 0.01}, {"ft", 0.3048}, {"km", 1000.0}}};

std::string name_of_axis(const Eigen::Vector3d& axis) {
  for (int i = 0; i < 3; ++i)
    if (axis[i] != 0) return fmt::format("{}{}", axis[i] < 0 ? "-" : "", "xyz"[i]);
  return {};
}

std::vector<std::string_view> split(std::string_view text) {
  std::vector<std::string_view> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

std::runtime_error invalid_convention(std::string_view text, const std::string& reason) {
  return std::runtime_error(fmt::format(
      "'{}' is not a pose convention: {}; give one or more of camera_from_world, wxyz, opengl, ros, unity, "
      "axes=RIGHT,DOWN,FORWARD (as x,-y,-z), mm, cm, ft, km, scale=METERS and clock=SECONDS, separated by commas",
      shown(text), reason));
}

/// Parser of a convention text; each kind of part may occur once.
class Parsed {
 public:
  explicit Parsed(std::string_view text) : text_(text), parts_(split(text)) {
    while (next_ < parts_.size()) parse_part(parts_[next_++]);
  }
  [[nodiscard]] const PoseConvention& convention() const { return convention_; }

 private:
  void parse_part(std::string_view part) {
    constexpr std::string_view kAxesPrefix = "axes=", kScalePrefix = "scale=", kClockPrefix = "clock=";
    const auto* const named = std::find_if(kAxes.begin(), kAxes.end(), [&](const auto& a) { return a.name == part; });
    const auto* const unit = std::find_if(kUnits.begin(), kUnits.end(), [&](const auto& u) { return u.first == part; });
    if (part == "wxyz") {
      set_once(has_order_), convention_.quaternion_w_first = true;
    } else if (part == "camera_from_world") {
      set_once(has_direction_), convention_.camera_from_world = true;
    } else if (named != kAxes.end()) {
      set_once(has_axes_), convention_.axes = axes_of(named->right, named->down, named->forward);
    } else if (unit != kUnits.end()) {
      set_once(has_scale_), convention_.scale = unit->second;
    } else if (part.starts_with(kAxesPrefix)) {
      set_once(has_axes_), parse_axes(part.substr(kAxesPrefix.size()));
    } else if (part.starts_with(kScalePrefix)) {
      set_once(has_scale_), convention_.scale = number(part.substr(kScalePrefix.size()));
      if (!(convention_.scale > 0)) throw invalid_convention(text_, "the scale must be more than 0");
    } else if (part.starts_with(kClockPrefix)) {
      set_once(has_clock_), convention_.clock = number(part.substr(kClockPrefix.size()));
    } else {
      throw invalid_convention(text_, fmt::format("'{}' is unknown", shown(part)));
    }
  }
  void parse_axes(std::string_view right) {
    if (next_ + 2 > parts_.size()) throw invalid_convention(text_, "axes= needs three directions");
    convention_.axes = axes_of(right, parts_[next_], parts_[next_ + 1]);
    next_ += 2;
    if (!(std::abs(convention_.axes.determinant()) > 0.5))
      throw invalid_convention(text_, "axes= needs x, y and z once each, with or without a minus");
  }
  [[nodiscard]] double number(std::string_view word) const {
    const auto value = number_in(word);
    if (!value || !std::isfinite(*value))
      throw invalid_convention(text_, fmt::format("'{}' is not a number", shown(word)));
    return *value;
  }
  void set_once(bool& has) const {
    if (std::exchange(has, true)) throw invalid_convention(text_, "it sets the same property twice");
  }

  std::string_view text_;
  std::vector<std::string_view> parts_;
  std::size_t next_ = 0;
  bool has_order_ = false, has_direction_ = false, has_axes_ = false, has_scale_ = false, has_clock_ = false;
  PoseConvention convention_;
};

}  // namespace

PoseConvention pose_convention(std::string_view text) {
  return text.empty() ? PoseConvention{} : Parsed(text).convention();
}

std::string to_string(const PoseConvention& c) {
  std::string all;
  const auto add = [&](const std::string& part) { all += (all.empty() ? "" : ",") + part; };
  if (c.quaternion_w_first) add("wxyz");
  if (c.camera_from_world) add("camera_from_world");
  if (c.axes != Eigen::Matrix3d::Identity()) {
    std::string name = fmt::format("axes={},{},{}", name_of_axis(c.axes.col(0)), name_of_axis(c.axes.col(1)),
                                   name_of_axis(c.axes.col(2)));
    for (const NamedAxes& named : kAxes)
      if (c.axes == axes_of(named.right, named.down, named.forward)) name = named.name;
    add(name);
  }
  if (c.scale != 1) {
    std::string name = fmt::format("scale={:g}", c.scale);
    for (const auto& [unit, meters] : kUnits)
      if (c.scale == meters) name = unit;
    add(name);
  }
  if (c.clock != 0) add(fmt::format("clock={:+g}", c.clock));
  return all;
}

Trajectory with_convention(Trajectory as_read, const PoseConvention& c) {
  const bool is_mirrored = c.axes.determinant() < 0;
  for (auto& [time, pose] : as_read) {
    time += c.clock;
    if (c.quaternion_w_first) {
      const Eigen::Quaterniond q(pose.linear());
      pose.linear() = Eigen::Quaterniond(q.x(), q.y(), q.z(), q.w()).toRotationMatrix();
    }
    pose.translation() *= c.scale;
    if (c.camera_from_world) pose = pose.inverse();
    pose.linear() = pose.linear() * c.axes;
    if (is_mirrored) {
      pose.linear() = c.axes.transpose() * pose.linear();
      pose.translation() = c.axes.transpose() * pose.translation();
    }
  }
  return as_read;
}

}  // namespace cairn
