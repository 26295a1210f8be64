// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/write_frames.hpp"

#include <oneapi/tbb/parallel_pipeline.h>

#include <atomic>
#include <exception>
#include <utility>

namespace cairn::apps {
namespace {

constexpr std::size_t kInFlight = 60;  // frames between sensor and disk, to cover a disk stall of two seconds

}  // namespace

void write_frames(const std::function<std::optional<Frame>()>& next,
                  const std::function<EncodedFrame(const Frame&)>& encode, Recorder& writer) {
  namespace tbb = oneapi::tbb;
  // Rethrown after the pipeline ends, because TBB would leak the current image of a throwing filter.
  std::exception_ptr failure;
  std::atomic<bool> failed = false;
  using tbb::filter_mode;
  tbb::parallel_pipeline(
      kInFlight, tbb::make_filter<void, Frame>(filter_mode::serial_in_order,
                                               [&](tbb::flow_control& flow) {
                                                 auto frame = failed ? std::nullopt : next();
                                                 if (!frame) flow.stop();
                                                 return std::move(frame).value_or(Frame{});
                                               }) &
                     tbb::make_filter<Frame, EncodedFrame>(filter_mode::parallel, encode) &
                     tbb::make_filter<EncodedFrame, void>(filter_mode::serial_in_order, [&](const EncodedFrame& frame) {
                       if (failed) return;
                       try {
                         writer.add(frame);
                       } catch (const std::exception&) {
                         failure = std::current_exception();
                         failed = true;
                       }
                     }));
  if (failure) std::rethrow_exception(failure);
}

}  // namespace cairn::apps
