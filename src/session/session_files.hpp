// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// A session: a folder from which a run goes on. `state.cbor` is written last and at once, and names what else belongs
// to it: a run's own folder, `run-N/`, with `keyframes/` (images and corners), `submap-N.vdb`, `frames-N-I.cbor` (the
// frames' poses, a thousand in each), `keyframes-N-I.cbor` and `loops-N-I.cbor` (what is known of them, some hundred in
// each), and `active-N.vdb`, the volume that is being fused into. A new run has a new folder, and the session before it
// stays whole until the new one's first checkpoint takes its place. A map made of others (PartFiles) leaves their
// images and submaps where they are.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "map/back_end.hpp"
#include "map/tracker.hpp"
#include "session/session_lock.hpp"

namespace cairn {

struct SessionState {
  Rig rig;
  FuseOptions fuse;
  float min_depth = 0, max_depth = 0;  // metres, see SurfaceOptions
  BackEnd::Memory back_end;
  Tracker::Saved tracker;
  Volume::Residency residency;
  std::uint32_t fused_count = 0;
  std::size_t last_image = 0;
  int repeats = 0;
  std::optional<double> last_fused;
  std::uint64_t number = 0;  // of the checkpoint
  std::string note;          // of whoever drives the mapper
};

/// What state.cbor names beside itself.
struct NamedFiles {
  static constexpr std::size_t kChunk = 256;  // keyframes or loops of a file
  std::string run;                            // the folder in which the others are
  /// With the keyframes, loops and frames that are not the newest.
  std::vector<std::string> keyframe_files, loop_files, frame_files;
  std::vector<PartFiles> parts;  // of other maps; folders as seen from the session's
};

/// A file with a part of a list, and the checksum of what it holds.
struct ChunkFile {
  std::string name;
  std::uint32_t checksum = 0;
};

/// A map by what it was made with.
struct MadeWith {
  const std::filesystem::path& map;
  const Rig& rig;
  const FuseOptions& fuse;
};
/// Throws std::runtime_error that names both where they are of different cameras or voxels, and so cannot be `joined`.
void check_alike(const MadeWith& first, const MadeWith& second, const char* joined);

/// Those that the session was made with; the others have their defaults.
[[nodiscard]] Options options_of(const SessionState& session);

struct ReadSession {
  SessionState session;
  BrickTree active;
  std::filesystem::path files;  // the run's folder
  std::uint32_t checksum = 0;   // of state.cbor
  FileLock hold;                // whoever writes leaves these files as long as this lives
  std::vector<ChunkFile> keyframe_files, loop_files;
  std::vector<std::string> frame_files;
  std::vector<PartFiles> parts;
  std::vector<FileLock> hold_parts;
};
/// Changes nothing in the folder, and may be called while another process writes there. Throws std::runtime_error with
/// what is wrong and what to do: nothing there, damaged, written by another version.
[[nodiscard]] ReadSession read_session(const std::filesystem::path& session);

/// What a page shows of a session beside its finished map.
struct SessionPictures {
  std::vector<double> timestamps;  // seconds, by keyframe
  SensorModel sensor;
  NumberedFiles keyframes;  // that colour_file names
  FileLock hold;            // whoever writes leaves them as long as this lives
  std::vector<FileLock> hold_parts;
};
/// Reads no voxels and no frames. Throws like read_session.
[[nodiscard]] SessionPictures read_pictures(const std::filesystem::path& session);

/// Writes a session: of one process at a time, see SessionLock.
class SessionWriter {
 public:
  /// Begins a new run. What is there stays until the first write.
  explicit SessionWriter(std::filesystem::path session);
  /// Goes on with the run that was read. `beside`: in a folder of its own with the same files, so that those of that
  /// run stay as they are as long as somebody holds them.
  SessionWriter(std::filesystem::path session, const ReadSession& read, bool beside = false);
  /// A run without a written state is gone with this.
  ~SessionWriter();
  SessionWriter(const SessionWriter&) = delete;
  SessionWriter& operator=(const SessionWriter&) = delete;

  /// Where keyframes and submaps are to be written.
  [[nodiscard]] const std::filesystem::path& files() const { return files_; }
  /// Brings a session's keyframes and submaps from where they lie, to go on with a copy of it. Those without a folder
  /// are here.
  void copy_files(const SessionState& session, const NumberedFiles& submaps, const NumberedFiles& keyframes) const;
  /// What is written from now on is made of other maps, too.
  void set_parts(std::vector<PartFiles> parts) { parts_ = std::move(parts); }
  /// Writes the volume's bricks, full chunks of keyframes, loops and frames that are new or changed, and then the
  /// state, each whole or not at all; a kill at any moment leaves the session before or this one. Files that no longer
  /// belong to it are removed then.
  void write(const SessionState& state, const BrickList& active);

 private:
  /// Full chunks of frames and the names of their files.
  struct FrameFiles {
    std::vector<std::shared_ptr<const FusedFrames::Chunk>> chunks;
    std::vector<std::string> names;
  };
  [[nodiscard]] FrameFiles write_frames(const FusedFrames& frames, std::uint64_t number) const;
  /// `written`: the files of the last state, which are not written again where they hold the same.
  template <class T>
  [[nodiscard]] std::vector<ChunkFile> write_chunks(const std::vector<T>& list, const char* what, std::uint64_t number,
                                                    const std::vector<ChunkFile>& written) const;
  /// Makes the folder of a new run.
  [[nodiscard]] std::filesystem::path make_run() const;
  /// Leaves what the state with that number and these files names.
  void remove_others(std::uint64_t number, const NamedFiles& named) const;
  std::filesystem::path session_;
  SessionLock lock_;
  std::filesystem::path files_;
  bool is_named_ = false;  // by state.cbor
  FrameFiles written_;     // of the last state, as these
  std::vector<ChunkFile> keyframe_files_, loop_files_;
  std::vector<PartFiles> parts_;
};

/// The bytes of state.cbor, and the way back to them: whatever was written since, the session is then what they name.
/// Whoever calls holds the session's lock. They throw std::runtime_error like read_session and write_whole.
[[nodiscard]] std::vector<std::uint8_t> bytes_of_state(const std::filesystem::path& session);
void restore_state(const std::filesystem::path& session, const std::vector<std::uint8_t>& bytes);

/// Removes a session that something newer has replaced; whoever calls holds its lock.
void remove_session(const std::filesystem::path& session, const SessionLock& lock);

}  // namespace cairn
