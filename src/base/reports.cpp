// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/reports.hpp"

namespace cairn {

std::string_view to_string(InertialReport::State state) {
  switch (state) {
    case InertialReport::State::absent:
      return "absent";
    case InertialReport::State::untested:
      return "untested";
    case InertialReport::State::trusted:
      return "trusted";
    case InertialReport::State::contradicted:
      return "contradicted";
  }
  return "absent";
}

std::string_view to_string(FrameState state) {
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

std::string_view to_string(InitialGuess guess) {
  switch (guess) {
    case InitialGuess::none:
      return "";
    case InitialGuess::motion:
      return "motion";
    case InitialGuess::still:
      return "still";
    case InitialGuess::features:
      return "features";
    case InitialGuess::relocalized:
      return "relocalized";
    case InitialGuess::gyroscope:
      return "gyroscope";
    case InitialGuess::device:
      return "device";
  }
  return "";
}

std::string_view to_string(FinishStage stage) {
  switch (stage) {
    case FinishStage::refine:
      return "refine";
    case FinishStage::adjust:
      return "adjust";
    case FinishStage::reintegrate:
      return "reintegrate";
  }
  return "";
}

std::string_view to_string(FrameCause cause) {
  switch (cause) {
    case FrameCause::none:
      return "";
    case FrameCause::unreadable:
      return "the frame could not be read";
    case FrameCause::wrong_size:
      return "the depth image does not have the camera's size";
    case FrameCause::bad_depth:
      return "a depth is negative or not a number; 0 means no measurement";
    case FrameCause::constant_depth:
      return "all depths are equal: the sensor sees nothing";
    case FrameCause::bad_timestamp:
      return "the timestamp is not a number";
    case FrameCause::timestamp_goes_back:
      return "the timestamp goes back";
    case FrameCause::stuck:
      return "the depth image repeats: the sensor is stuck";
    case FrameCause::too_little_depth:
      return "too little depth to start the map";
    case FrameCause::no_pose:
      return "no pose is given for this time";
    case FrameCause::bad_pose:
      return "the given pose is not a rotation and translation";
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
      return "the motion is too fast";
    case FrameCause::poor_fit:
      return "the frame fits the map badly from every initial pose";
    case FrameCause::not_relocalized:
      return "not relocalized yet";
    case FrameCause::new_component:
      return "not relocalized: starts a new component of the map";
    case FrameCause::partly_used:
      return "only part of it is used";
  }
  return "";
}

}  // namespace cairn
