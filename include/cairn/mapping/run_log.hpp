// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/eval/verdict.hpp"
#include "cairn/mapping/mapper.hpp"

namespace cairn {

/// Logs a run to an MCAP file with Foxglove's schemas, for playback in Foxglove and Rerun in the recording's time:
/// poses, images, the growing surface and events. docs/outputs.md lists the topics. Encodes, compresses and writes in
/// its own thread. Use from the mapper's thread.
class RunLog {
 public:
  /// Throws std::runtime_error for a file name without .mcap, an existing file, or a file that cannot be written.
  /// `replace`: overwrites the log of an earlier run; any other existing file remains an error.
  explicit RunLog(const std::filesystem::path& file, bool replace = false);
  /// Ends the file as finish() does.
  ~RunLog();
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  /// Starts a new map, which must live until the next call or the end of the log; clears the data shown for the
  /// previous map.
  void begin(Mapper& mapper, const Rig& rig);
  /// Logs a frame. Call after each frame.
  void add(const Frame& frame, const FrameReport& report);
  void warn(std::string_view text);
  /// Logs the rest of the surface. Call after the last frame. Calls Mapper::finish_optimization.
  void finishing();
  /// Logs the final state of the written map, and ends the file.
  void finish(const Verdict& verdict);

  /// Reason why logging stopped, in one line: the file could not be written or its disk is nearly full. Earlier data
  /// remain in the file.
  [[nodiscard]] std::optional<std::string> problem() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
