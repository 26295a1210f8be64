// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "cairn/mapper.hpp"
#include "cairn/verdict.hpp"

namespace cairn {

/// Logs a run in an MCAP file by Foxglove's schemas, with which Foxglove and Rerun replay it in the recording's time:
/// poses, images, the surface as it grows, what happened. docs/formats.md has the topics. It encodes, packs and writes
/// in a thread of its own. The mapper's thread.
class RunLog {
 public:
  /// Throws std::runtime_error for a file whose name does not end in .mcap, that exists, or that cannot be written.
  /// `replace`: the log of an earlier run is replaced, any other file still is an error.
  explicit RunLog(const std::filesystem::path& file, bool replace = false);
  /// Ends the file as finish() does.
  ~RunLog();
  RunLog(const RunLog&) = delete;
  RunLog& operator=(const RunLog&) = delete;

  /// A new map, which must live until the next one or the end; what was shown of another one goes.
  void begin(Mapper& mapper, const Rig& rig);
  /// After each frame.
  void add(const Frame& frame, const FrameReport& report);
  void warn(std::string_view text);
  /// The last frame has come: logs what of the surface is not logged yet. Settles the mapper.
  void finishing();
  /// Logs how the map stands now that it is written, and ends the file.
  void finish(const Verdict& verdict);

  /// Why nothing is logged any more, in one line, once the file could not be written or its disk is nearly full. What
  /// was logged before stays.
  [[nodiscard]] std::optional<std::string> problem() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
