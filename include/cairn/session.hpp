// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "cairn/mapper.hpp"

namespace cairn {

/// A folder from which a map can be gone on with after its program has ended or was killed.
///
///   cairn::Session session = cairn::Session::create("desk/session");
///   cairn::Mapper mapper = session.mapper(rig, options);
///   while (auto frame = source->next()) mapper.add(*frame);
///   session.checkpoint(mapper);
///
/// One process at a time writes into a session. One thread at a time.
class Session {
 public:
  /// The format that is written, and the oldest that is read: that of the version before.
  static constexpr int kFormat = 15, kOldestFormat = 9;

  /// Begins a session. One that is there stays until this one's first checkpoint. Throws std::runtime_error while
  /// somebody else writes there.
  [[nodiscard]] static Session create(const std::filesystem::path& folder);
  /// The session in a folder, to go on with. Throws std::runtime_error if there is none, it is damaged, or somebody
  /// else writes there. `keep_start`: checkpoints leave what is there now beside what they write, for
  /// return_to_start().
  [[nodiscard]] static Session resume(const std::filesystem::path& folder, bool keep_start = false);
  /// The session in `from`, to go on with in `to`: a copy, which counts from its first checkpoint. Throws as resume
  /// does.
  [[nodiscard]] static Session copy(const std::filesystem::path& from, const std::filesystem::path& to);
  ~Session();
  Session(Session&&) noexcept;
  Session& operator=(Session&&) noexcept;

  /// The mapper whose keyframes and submaps lie in this session, once: a new one, or the one of the last checkpoint as
  /// if nothing had happened. Throws std::runtime_error as Mapper's constructor does, and when the session was made
  /// with another camera or voxel size.
  [[nodiscard]] Mapper mapper(const Rig& rig, const Options& options, int device = -1);
  /// The same with the camera and the options of the last checkpoint.
  [[nodiscard]] Mapper mapper(int device = -1);

  /// Writes all that is needed to go on from here, beside the next frames. `note` is given back by info. A kill at any
  /// moment leaves the last checkpoint that was written.
  void checkpoint(const Mapper& mapper, const std::string& note = {});
  /// Waits for the checkpoint being written. Returns why session files cannot be written, if so; the map is not harmed.
  [[nodiscard]] std::optional<std::string> problem();

  /// The session as resume() has found it, on the disk as well: what was written since is removed. The mapper that came
  /// of it must be gone; mapper() gives the one of then. Throws std::runtime_error where the start was not kept, or the
  /// files cannot be written or read.
  void return_to_start();
  /// There is no way back any more: the next checkpoint removes what was kept of the start.
  void release_start();

  /// What a session was made with.
  struct Info {
    Rig rig;
    float voxel_size = 0, truncation = 0;  ///< metres, see FuseOptions
    float min_depth = 0, max_depth = 0;    ///< metres, see SurfaceOptions
    std::string note;                      ///< what checkpoint was given
  };
  /// Of the last checkpoint. Throws std::runtime_error if there is no session or it is damaged.
  [[nodiscard]] static Info info(const std::filesystem::path& folder);

  struct Merged {
    int compared = 0, loops = 0;  ///< keyframes of the other session; loops to this one
    bool joined = false;          ///< the loops that agree join the two
  };
  /// Makes a session in `to` of those in `maps`, of which each is compared with those before it: their maps lie to each
  /// other as what they see in common says, and all keyframes where tracking and loops agree best. Memory holds one or
  /// two of them at a time. The sessions that are given stay as they are, and are not needed any more. Returns by map
  /// what joins it with those before it. Throws std::runtime_error when cameras or voxels differ, and, without
  /// `allow_apart`, for a map that nothing joins with most of the others; then nothing is written.
  static std::vector<Merged> join(const std::vector<std::filesystem::path>& maps, const std::filesystem::path& to,
                                  bool allow_apart = false, int device = -1);
  /// Adds the map of the session in `other` to this session's mapper, by what both have seen. Nothing in `other`
  /// changes. Throws std::runtime_error when cameras or voxels differ.
  static Merged merge(Mapper& mapper, const std::filesystem::path& other, int device = -1);

  class State;

 private:
  explicit Session(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

/// The session of an earlier run in a folder that gets a map without one. Nobody else writes into it meanwhile.
class ReplacedSession {
 public:
  /// Throws std::runtime_error while somebody else writes there.
  explicit ReplacedSession(const std::filesystem::path& folder);
  ~ReplacedSession();
  ReplacedSession(const ReplacedSession&) = delete;
  ReplacedSession& operator=(const ReplacedSession&) = delete;
  /// Removes it, once what replaces it is written.
  void remove();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cairn
