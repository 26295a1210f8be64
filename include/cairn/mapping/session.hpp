// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapping/mapper.hpp"

namespace cairn {

/// Saved state of a map in a folder, from which a run continues after its program has ended or was killed.
///
///   cairn::Session session = cairn::Session::create("desk/session");
///   cairn::Mapper mapper = session.mapper(rig, options);
///   while (auto frame = source->next()) mapper.add(*frame);
///   session.checkpoint(mapper);
///
/// One process at a time writes to a session. Not thread-safe: use from one thread at a time.
class Session {
 public:
  /// Written format version, and the oldest readable version: the format of the previous release.
  static constexpr int kFormat = 18, kOldestFormat = 9;

  /// Creates a session. An existing session remains until the first checkpoint of the new one. Throws
  /// std::runtime_error if another process writes there.
  [[nodiscard]] static Session create(const std::filesystem::path& folder);
  /// Opens the session in a folder to continue it. Throws std::runtime_error for a missing, damaged or locked session.
  /// `keep_start`: checkpoints preserve the current state beside the new one, for return_to_start().
  [[nodiscard]] static Session resume(const std::filesystem::path& folder, bool keep_start = false);
  /// Copies the session in `from` to `to` and continues the copy, which is valid after its first checkpoint. Throws as
  /// resume does.
  [[nodiscard]] static Session copy(const std::filesystem::path& from, const std::filesystem::path& to);
  ~Session();
  Session(Session&&) noexcept;
  Session& operator=(Session&&) noexcept;

  /// Creates the mapper that stores its keyframes and submaps in this session; call once. The mapper is new, or
  /// restored exactly from the last checkpoint. Throws std::runtime_error as Mapper's constructor does, and if the
  /// session has another camera or voxel size.
  [[nodiscard]] Mapper mapper(const Rig& rig, const Options& options, int device = -1);
  /// As above, with the camera and options of the last checkpoint.
  [[nodiscard]] Mapper mapper(int device = -1);

  /// Starts writing a checkpoint with all state needed to continue, while further frames are added. `note` is returned
  /// by info. A kill at any moment leaves the last complete checkpoint.
  void checkpoint(const Mapper& mapper, const std::string& note = {});
  /// Waits for the checkpoint in progress. Returns the reason if session files cannot be written; the map is
  /// unaffected.
  [[nodiscard]] std::optional<std::string> problem();

  /// Restores the state found by resume(), on the disk as well, and removes later checkpoints. Destroy the mapper
  /// before; mapper() then returns the restored one. Throws std::runtime_error if the start was not kept, or the files
  /// cannot be written or read.
  void return_to_start();
  /// Gives up return_to_start(): the next checkpoint removes the kept start.
  void release_start();

  /// Settings of a session.
  struct Info {
    Rig rig;
    float voxel_size = 0, truncation = 0;  ///< meters, see FuseOptions
    float min_depth = 0, max_depth = 0;    ///< meters, see SurfaceOptions
    std::string note;                      ///< note given to checkpoint
  };
  /// Settings from the last checkpoint. Throws std::runtime_error for a missing or damaged session.
  [[nodiscard]] static Info info(const std::filesystem::path& folder);

 private:
  class State;
  explicit Session(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// Lock on an earlier run's session in a folder whose new map has no session. Prevents other writers meanwhile.
class ReplacedSession {
 public:
  /// Throws std::runtime_error if another process writes there.
  explicit ReplacedSession(const std::filesystem::path& folder);
  ~ReplacedSession();
  ReplacedSession(const ReplacedSession&) = delete;
  ReplacedSession& operator=(const ReplacedSession&) = delete;
  /// Removes the old session. Call after its replacement is written.
  void remove();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
