// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <functional>
#include <optional>

#include "cairn/io/recorder.hpp"

namespace cairn::apps {

/// Writes all frames returned by `next`, in order, with reading, encoding and writing in parallel.
void write_frames(const std::function<std::optional<Frame>()>& next,
                  const std::function<EncodedFrame(const Frame&)>& encode, Recorder& writer);

}  // namespace cairn::apps
