// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "sources.hpp"

#include <fmt/format.h>

#include <array>
#include <boost/crc.hpp>
#include <stdexcept>

#include "io/wrapped_source.hpp"
#include "synth/source.hpp"

namespace cairn::apps {
namespace {

constexpr std::string_view kSynthetic = "synthetic:", kSensor = "openni:";

/// A range of a source that can only be read in order.
class InRange final : public WrappedSource {
 public:
  InRange(std::unique_ptr<Source> source, const FrameRange& range) : WrappedSource(std::move(source)), range_(range) {}
  std::optional<int> size() const override {
    const auto all = source_->size();
    if (!all) return all;
    return std::max(
        0, (std::min(read_ + *all, range_.end.value_or(read_ + *all)) - next_ + range_.step - 1) / range_.step);
  }
  std::optional<Frame> next() override {
    if (range_.end && next_ >= *range_.end) return std::nullopt;
    while (auto frame = source_->next())
      if (read_++ == next_) {
        next_ += range_.step;
        return frame;
      }
    return std::nullopt;
  }

 private:
  FrameRange range_;
  int read_ = 0, next_ = range_.begin;
};

}  // namespace

bool is_sensor(std::string_view sequence) { return sequence.starts_with(kSensor) && !sequence.ends_with(".oni"); }

std::unique_ptr<Source> open_sequence(const std::string& sequence, const Opening& opening) {
  if (sequence.starts_with(kSensor) || sequence.ends_with(".oni")) {
    const std::string uri = sequence.starts_with(kSensor) ? sequence.substr(kSensor.size()) : sequence;
    return std::make_unique<InRange>(open_openni(uri, {.camera = opening.camera, .copy_to = opening.copy_to}),
                                     opening.range);
  }
  if (!opening.camera.empty())
    throw std::runtime_error("--camera is for sensors and .oni files; " + sequence + " tells its own camera");
  if (sequence.starts_with(kSynthetic))
    return open_synthetic({.scene = sequence.substr(kSynthetic.size()),
                           .first = opening.range.begin,
                           .frames = opening.range.end.value_or(300)});
  return open_recording(sequence, opening.range);
}

std::filesystem::path tidy(const std::filesystem::path& path) {
  const auto whole = std::filesystem::weakly_canonical(std::filesystem::absolute(path));
  return whole.has_filename() ? whole : whole.parent_path();
}

std::string identity(const std::string& sequence, const std::filesystem::path& camera) {
  if (is_sensor(sequence) || sequence.starts_with(kSynthetic)) return sequence;
  constexpr int kFrames = 3, kTries = 30;  // frames; readable ones among the first
  const auto source = open_sequence(sequence, {.range = {}, .camera = camera, .copy_to = {}});
  boost::crc_optimal<64, 0x42f0e1eba9ea3693u, ~0ull, ~0ull, true, true> sum;  // ECMA-182
  const auto take = [&](const auto& values) {
    sum.process_bytes(std::data(values), std::size(values) * sizeof(*std::data(values)));
  };
  const Camera& c = source->camera();
  take(std::array{c.width, c.height});
  take(std::array{c.fx, c.fy, c.cx, c.cy});
  take(c.distortion);
  for (int tried = 0, taken = 0; tried < kTries && taken < kFrames; ++tried) {
    const auto frame = source->next();
    if (!frame) break;
    if (!frame->problem.empty()) continue;
    take(std::array{frame->timestamp});
    take(frame->depth);
    ++taken;
  }
  return fmt::format("recording {:016x}", sum.checksum());
}

}  // namespace cairn::apps
