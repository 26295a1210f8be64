// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/reports.hpp"

namespace cairn {

std::string_view name_of(FrameState state) {
  switch (state) {
    case FrameState::fused:
      return "fused";
    case FrameState::lost:
      return "lost";
    case FrameState::skipped:
      return "skipped";
    case FrameState::held_out:
      return "held_out";
  }
  return "";
}

std::string_view text_of(FrameCause cause) {
  switch (cause) {
    case FrameCause::none:
      return "";
    case FrameCause::unreadable:
      return "the frame could not be read";
    case FrameCause::wrong_size:
      return "the depth image is not of the camera's size";
    case FrameCause::bad_depth:
      return "a depth is negative or no number: 0 stands for no measurement";
    case FrameCause::constant_depth:
      return "every depth is the same: the sensor shows nothing";
    case FrameCause::bad_timestamp:
      return "the timestamp is not a number";
    case FrameCause::timestamp_goes_back:
      return "the timestamp goes back";
    case FrameCause::stuck:
      return "the depth image repeats: the sensor is stuck";
    case FrameCause::too_little_depth:
      return "too little depth to begin the map with";
    case FrameCause::no_pose:
      return "no pose is given for this time";
    case FrameCause::bad_pose:
      return "the given pose is no rotation and translation";
    case FrameCause::far_pose:
      return "the given pose is too far from the origin for voxels of this size";
    case FrameCause::little_depth:
      return "too little depth";
    case FrameCause::out_of_view:
      return "the map is out of view";
    case FrameCause::too_few_inliers:
      return "too few points fit the map";
    case FrameCause::large_residuals:
      return "points fit the map badly";
    case FrameCause::too_fast:
      return "no hand moves like that";
    case FrameCause::poor_fit:
      return "the frame fits the map badly from every guess";
    case FrameCause::not_relocalised:
      return "not found again yet";
    case FrameCause::new_component:
      return "not found again: begins a new piece of the map";
    case FrameCause::partly_used:
      return "only a part of it is used";
  }
  return "";
}

}  // namespace cairn
