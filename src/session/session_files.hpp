// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Session: a folder from which a run resumes. `state.cbor` is written last and atomically, and names all other files: a
// run's own folder, `run-N/`, with `keyframes/` (images and corners), `submap-N.vdb`, `frames-N-I.cbor` (the frames'
// poses, a thousand in each), `keyframes-N-I.cbor` and `loops-N-I.cbor` (keyframe and loop data, some hundred in each),
// and `active-N.vdb`, the active volume. A new run has a new folder; the previous session stays complete until the
// first checkpoint of the new run replaces it. A merged map (SourceMapFiles) leaves images and submaps in the folders
// of its source maps.
#pragma once
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "mapper/back_end.hpp"
#include "mapper/tracker.hpp"
#include "session/session_lock.hpp"

namespace cairn {

struct SessionState {
  Rig rig;
  FuseOptions fuse;
  float min_depth = 0, max_depth = 0;  // meters, see SurfaceOptions
  BackEnd::State back_end;
  Tracker::SavedState tracker;
  Volume::SavedState residency;
  std::uint32_t fused_count = 0;
  std::size_t last_depth_hash = 0;
  int repeated_images = 0;
  std::optional<double> last_fused;
  std::uint64_t number = 0;  // of the checkpoint
  std::string note;          // of the mapper's caller
};

/// Files that state.cbor names.
struct NamedFiles {
  static constexpr std::size_t kChunk = 256;  // keyframes or loops in a file
  std::string run;                            // folder of the files
  /// Full chunks of keyframes, loops and frames.
  std::vector<std::string> keyframe_files, loop_files, frame_files;
  std::vector<SourceMapFiles> source_maps;  // folders relative to the session's
};

/// File with a chunk of a list, and the checksum of its contents.
struct ChunkFile {
  std::string name;
  std::uint32_t checksum = 0;
};

/// Map with its rig and its fusion options.
struct MapSettings {
  const std::filesystem::path& map;
  const Rig& rig;
  const FuseOptions& fuse;
};
/// Throws std::runtime_error with both names if different cameras or voxel options prevent the maps from being
/// `joined`.
void check_alike(const MapSettings& first, const MapSettings& second, const char* joined);

/// Options stored with the session; all other options have their defaults.
[[nodiscard]] Options options_of(const SessionState& session);

struct ReadSession {
  SessionState session;
  BrickTree active;
  std::filesystem::path files;  // the run's folder
  std::uint32_t checksum = 0;   // of state.cbor
  FileLock hold;                // prevents writers from removing these files
  std::vector<ChunkFile> keyframe_files, loop_files;
  std::vector<std::string> frame_files;
  std::vector<SourceMapFiles> source_maps;
  std::vector<FileLock> hold_source_maps;
};
/// Reads a session. Changes no file, and is safe while another process writes there. Throws std::runtime_error with the
/// cause (missing, damaged, written by another version) and the remedy.
[[nodiscard]] ReadSession read_session(const std::filesystem::path& session);

/// Session data that a viewer page shows beside the finished map.
struct SessionPictures {
  std::vector<double> timestamps;  // seconds, by keyframe
  SensorModel sensor;
  NumberedFiles keyframes;  // named by color_file
  FileLock hold;            // prevents writers from removing the files
  std::vector<FileLock> hold_source_maps;
};
/// Reads no voxels and no frames. Throws like read_session.
[[nodiscard]] SessionPictures read_pictures(const std::filesystem::path& session);

/// Writes a session; only one process at a time may do so, see SessionLock.
class SessionWriter {
 public:
  /// Starts a new run. Existing files stay until the first write.
  explicit SessionWriter(std::filesystem::path session);
  /// Resumes the run that was read. `in_new_run`: uses a new folder with the same files, so that the old run's files
  /// stay unchanged as long as they are locked.
  SessionWriter(std::filesystem::path session, const ReadSession& read, bool in_new_run = false);
  /// Removes a run without a written state.
  ~SessionWriter();
  SessionWriter(const SessionWriter&) = delete;
  SessionWriter& operator=(const SessionWriter&) = delete;

  /// Folder for keyframes and submaps.
  [[nodiscard]] const std::filesystem::path& files() const { return files_; }
  /// Copies a session's keyframes and submaps here, to resume from a copy. Entries without a folder are already here.
  void copy_files(const SessionState& session, const NumberedFiles& submaps, const NumberedFiles& keyframes) const;
  /// Sets the source maps that later states refer to.
  void set_source_maps(std::vector<SourceMapFiles> source_maps) { source_maps_ = std::move(source_maps); }
  /// Writes the volume's bricks, new or changed chunks of keyframes, loops and frames, and finally the state, each
  /// atomically; a kill at any moment leaves either the previous session or this one. Then removes obsolete files.
  void write(const SessionState& state, const BrickList& active);

 private:
  /// Full chunks of frames with the names of their files.
  struct FrameFiles {
    std::vector<std::shared_ptr<const FusedFrames::Chunk>> chunks;
    std::vector<std::string> names;
  };
  [[nodiscard]] FrameFiles write_frames(const FusedFrames& frames, std::uint64_t number) const;
  /// `written`: files of the last state, reused if their contents are unchanged.
  template <class T>
  [[nodiscard]] std::vector<ChunkFile> write_chunks(const std::vector<T>& list, const char* what, std::uint64_t number,
                                                    const std::vector<ChunkFile>& written) const;
  /// Makes the folder of a new run.
  [[nodiscard]] std::filesystem::path make_run() const;
  /// Removes all files except the state with the given number and its named files.
  void remove_others(std::uint64_t number, const NamedFiles& named) const;
  std::filesystem::path session_;
  SessionLock lock_;
  std::filesystem::path files_;
  bool is_referenced_ = false;  // by state.cbor
  FrameFiles written_;          // of the last state, like the lists below
  std::vector<ChunkFile> keyframe_files_, loop_files_;
  std::vector<SourceMapFiles> source_maps_;
};

/// Bytes of state.cbor, and the function to restore them: the session then returns to that state, whatever was written
/// since. The caller holds the session's lock. Both throw std::runtime_error like read_session and write_whole.
[[nodiscard]] std::vector<std::uint8_t> bytes_of_state(const std::filesystem::path& session);
void restore_state(const std::filesystem::path& session, const std::vector<std::uint8_t>& bytes);

/// Removes a session replaced by a newer result. The caller holds its lock.
void remove_session(const std::filesystem::path& session, const SessionLock& lock);

}  // namespace cairn
