// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Scenes are rendered on the device, which is not fuzzed: here no name is a scene or a sensor, and recordings are
// opened by open_recording alone.
#include <stdexcept>

#include "cairn/eval/verdict.hpp"
#include "cairn/io/source.hpp"
#include "io/reproject_to.hpp"
#include "synth/source.hpp"

namespace cairn {

bool is_synthetic(std::string_view) { return false; }
Trajectory synthetic_truth(const std::string&) { return {}; }

bool is_sensor(std::string_view) { return false; }
std::unique_ptr<Source> open_source(const std::string&, const SourceOptions&) {
  throw std::runtime_error("no source is opened here");
}
/// Only a plan's verdict is read here; a run's verdict needs the features of images.
std::string to_string(Verdict::Level) { return "weak"; }
std::unique_ptr<Source> reproject_to(std::unique_ptr<Source> source, const Rig&) { return source; }

}  // namespace cairn
