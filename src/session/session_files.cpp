// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/session_files.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <functional>
#include <iterator>
#include <span>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/atomic_file.hpp"
#include "base/json_text.hpp"
#include "base/read_json.hpp"
#include "base/read_whole.hpp"
#include "base/system_file.hpp"
#include "geometry/readout.hpp"
#include "map/keyframe_files.hpp"
#include "session/checked_file.hpp"
#include "session/state.hpp"
#include "session/validate.hpp"
#include "volume/vdb/brick_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStateKind = "cairn session";
constexpr const char *kFrames = "frames", *kLoops = "loops";
constexpr const char* kState = "state.cbor";
constexpr const char* kKeyframes = "keyframes";
constexpr const char* kRemedy = "begin a new session";

fs::path active_file(const fs::path& files, std::uint64_t number) {
  return files / fmt::format("active-{:06}.vdb", number);
}

/// File name of one chunk of a list.
std::string chunk_name(const char* what, std::uint64_t number, std::size_t i) {
  return fmt::format("{}-{:06}-{:06}.cbor", what, number, i);
}
bool is_chunk(std::string_view name, std::string_view what) {
  return name.starts_with(what) && name.substr(what.size()).starts_with('-') && name.ends_with(".cbor") &&
         name.find('/') == std::string_view::npos;
}
std::string kind_of(const char* what) { return fmt::format("cairn {}", what); }

CheckedBytes read_state(const fs::path& session) {
  const fs::path file = session / kState;
  if (const fs::path home = session.parent_path(); !fs::exists(file) && fs::exists(home / "plan.json"))
    throw std::runtime_error(
        fmt::format("{0}: is a plan whose maps are not merged yet; cairn info {0} reports "
                    "the next command, and cairn optimize {0} merges them",
                    home.string()));
  if (!fs::exists(file)) throw std::runtime_error(file.string() + ": no session to resume; begin a new session");
  try {
    return read_checked(file, kStateKind);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}; {}", error.what(), kRemedy));
  }
}

/// Flushes the file system of a folder: with many keyframe files, one call is cheaper than a sync of each.
void sync_disk(const fs::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = descriptor >= 0 && syncfs(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0) close(descriptor);
  if (!synced) throw std::runtime_error("cannot write " + folder.string() + ": " + std::strerror(error));
}

/// True if the session has a state with this checksum.
bool has_state(const fs::path& session, std::uint32_t checksum) {
  try {
    return read_state(session).checksum == checksum;
  } catch (const std::exception&) {
    return false;
  }
}

/// Includes the newest keyframes, loops and frames; chunk files are still to be read.
StateFile parse_state(const CheckedBytes& read) {
  StateFile state = state_of(parsed_cbor(read.bytes), read.format);
  if (!run_number(state.files.run)) throw std::runtime_error("has no run folder");
  const auto check = [](const std::vector<std::string>& names, const char* what) {
    for (const std::string& name : names)
      if (!is_chunk(name, what)) throw std::runtime_error(fmt::format("{} are missing", what));
  };
  check(state.files.keyframe_files, kKeyframes);
  check(state.files.loop_files, kLoops);
  check(state.files.frame_files, kFrames);
  return state;
}

/// Reads a full chunk of a list with `list_of(json, format)`. Returns it with the checksum of its file.
template <class ListOf>
auto read_chunk(const fs::path& file, const char* what, std::size_t full, const ListOf& list_of) {
  const CheckedBytes read = read_checked(file, kind_of(what));
  try {
    auto list = list_of(parsed_cbor(read.bytes), read.format);
    if (list.size() != full) throw std::runtime_error(fmt::format("{} are missing", what));
    return std::pair(std::move(list), read.checksum);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}: is damaged ({})", file.string(), plain(error.what())));
  }
}

/// Inserts the contents of chunk files before a list's newest elements.
template <class T, class ListOf>
std::vector<ChunkFile> read_chunks(const fs::path& files, const std::vector<std::string>& names, const char* what,
                                   std::vector<T>& list, const ListOf& list_of) {
  std::vector<T> all;
  std::vector<ChunkFile> chunks;
  for (const std::string& name : names) {
    auto [chunk, checksum] = read_chunk(files / name, what, NamedFiles::kChunk, list_of);
    chunks.push_back({name, checksum});
    std::move(chunk.begin(), chunk.end(), std::back_inserter(all));
  }
  std::move(list.begin(), list.end(), std::back_inserter(all));
  list = std::move(all);
  return chunks;
}

FusedFrames read_frames(const fs::path& files, const std::vector<std::string>& names, const Atlas& atlas) {
  FusedFrames frames;
  const auto valid = [&](const nlohmann::json& json, int format) {
    auto chunk = frames_of(json, format);
    validate(chunk, atlas.keyframes.size());
    return chunk;
  };
  for (const std::string& name : names)
    frames.push_back(std::make_shared<const FusedFrames::Chunk>(
        read_chunk(files / name, kFrames, FusedFrames::kChunk, valid).first));
  for (const FusedFrame& frame : atlas.frames.rest()) frames.push_back(frame);
  return frames;
}

/// Resolves the folders of other maps, and locks them as long as `hold` lives. Throws std::runtime_error if a folder is
/// missing.
std::vector<SourceMapFiles> find_source_maps(const fs::path& session, std::vector<SourceMapFiles> source_maps,
                                             std::vector<FileLock>& hold) {
  for (SourceMapFiles& source : source_maps) {
    source.folder = (session / source.folder).lexically_normal();
    if (!fs::is_directory(source.folder))
      throw std::runtime_error(source.folder.string() + ": is missing: a part of the map in " + session.string() +
                               " was rebuilt or removed: run cairn optimize again");
    hold.push_back(*FileLock::take(source.folder, FileLock::Kind::shared, true));
  }
  return source_maps;
}

[[noreturn]] void throw_damaged(const std::string& what) {
  throw std::runtime_error(what + "; the session is damaged: " + kRemedy);
}

/// Contents of a state without voxels, and with only the newest frames. The function below throws with the defect of
/// the state or its files, and with the remedy.
struct StateContents {
  StateFile state;
  fs::path files;
  FileLock hold;
  std::vector<ChunkFile> keyframe_files, loop_files;
};
StateContents read_contents(const fs::path& session, const CheckedBytes& bytes) {
  const auto checked = [&](const auto& read) {
    try {
      return read();
    } catch (const std::exception& error) {
      throw std::runtime_error(
          fmt::format("{}: is damaged ({}); {}", (session / kState).string(), plain(error.what()), kRemedy));
    }
  };
  StateFile state = checked([&] { return parse_state(bytes); });
  const fs::path files = session / state.files.run;
  if (!fs::is_directory(files)) throw_damaged(files.string() + ": is missing");
  StateContents contents{.state = std::move(state),
                         .files = files,
                         .hold = *FileLock::take(files, FileLock::Kind::shared, true),
                         .keyframe_files = {},
                         .loop_files = {}};
  const NamedFiles& named = contents.state.files;
  Atlas& atlas = contents.state.session.back_end.atlas;
  try {
    contents.keyframe_files = read_chunks(files, named.keyframe_files, kKeyframes, atlas.keyframes, keyframes_of);
    contents.loop_files = read_chunks(files, named.loop_files, kLoops, atlas.loops, loops_of);
  } catch (const std::exception& error) {
    throw_damaged(error.what());
  }
  checked([&] {
    validate(contents.state.session, FusedFrames::kChunk * named.frame_files.size() + atlas.frames.size());
    validate(named, contents.state.session.back_end);
  });
  return contents;
}

/// Reads all contents of a state.
ReadSession read_files(const fs::path& session, const CheckedBytes& bytes) {
  StateContents contents = read_contents(session, bytes);
  SessionState& s = contents.state.session;
  NamedFiles& named = contents.state.files;
  std::vector<FileLock> hold_source_maps;
  std::vector<SourceMapFiles> source_maps = find_source_maps(session, std::move(named.source_maps), hold_source_maps);
  try {
    BrickTree active = BrickFile(active_file(contents.files, s.number)).read();
    s.back_end.atlas.frames = read_frames(contents.files, named.frame_files, s.back_end.atlas);
    return {.session = std::move(s),
            .active = std::move(active),
            .files = contents.files,
            .checksum = bytes.checksum,
            .hold = std::move(contents.hold),
            .keyframe_files = std::move(contents.keyframe_files),
            .loop_files = std::move(contents.loop_files),
            .frame_files = std::move(named.frame_files),
            .source_maps = std::move(source_maps),
            .hold_source_maps = std::move(hold_source_maps)};
  } catch (const std::exception& error) {
    throw_damaged(error.what());
  }
}

std::vector<std::string> names_of(const std::vector<ChunkFile>& files) {
  std::vector<std::string> names(files.size());
  std::transform(files.begin(), files.end(), names.begin(), [](const ChunkFile& file) { return file.name; });
  return names;
}

/// Makes hard links instead of copies, since files are written atomically and never changed. Copies on a disk without
/// links.
void link_files(const fs::path& from, const fs::path& to) {
  for (const auto& entry : fs::directory_iterator(from)) {
    if (!entry.is_regular_file() || is_temporary(entry.path().filename().string())) continue;
    std::error_code error;
    fs::create_hard_link(entry.path(), to / entry.path().filename(), error);
    if (error) fs::copy_file(entry.path(), to / entry.path().filename());
  }
}

bool all_in(const fs::path& folder,
            const std::function<bool(const fs::directory_entry&, const std::string&)>& is_ours) {
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (!is_temporary(name) && !is_ours(entry, name)) return false;
  }
  return true;
}

/// True if a folder contains only files of a run. A user's own folder of the same name is never removed.
bool is_run(const fs::path& folder) {
  if (!run_number(folder.filename().string()) || !fs::is_directory(fs::symlink_status(folder))) return false;
  return all_in(folder, [](const auto& entry, const std::string& name) {
    if (name == kKeyframes && fs::is_directory(entry.symlink_status()))
      return all_in(entry.path(), [](const auto& file, const std::string& of_file) {
        return file.is_regular_file() && is_keyframe_file(of_file);
      });
    const bool is_volume = (name.starts_with("submap-") || name.starts_with("active-")) && name.ends_with(".vdb");
    return entry.is_regular_file() &&
           (is_volume || is_chunk(name, kFrames) || is_chunk(name, kKeyframes) || is_chunk(name, kLoops));
  });
}

std::vector<fs::path> runs_in(const fs::path& session) {
  std::vector<fs::path> runs;
  for (const auto& entry : fs::directory_iterator(session))
    if (is_run(entry.path())) runs.push_back(entry.path());
  return runs;
}

/// Removes the runs without a reader.
void remove_runs(const fs::path& session) {
  std::error_code ignored;
  for (const fs::path& run : runs_in(session))
    if (FileLock::take(run, FileLock::Kind::exclusive)) fs::remove_all(run, ignored);
}

}  // namespace

void check_alike(const MapSettings& first, const MapSettings& second, const char* joined) {
  // Keyframes are corrected for the readout.
  if (!with_global_shutter(first.rig).has_same_cameras(with_global_shutter(second.rig)))
    throw std::runtime_error(fmt::format("{}: was made with another camera than {}; such maps cannot be {}",
                                         second.map.string(), first.map.string(), joined));
  if (first.fuse.voxel_size != second.fuse.voxel_size || first.fuse.truncation != second.fuse.truncation)
    throw std::runtime_error(fmt::format("{}: has voxels of {} m, {} of {} m; make both with the same --voxel-size",
                                         second.map.string(), second.fuse.voxel_size, first.map.string(),
                                         first.fuse.voxel_size));
}

Options options_of(const SessionState& session) {
  Options options;
  options.fuse.voxel_size = session.fuse.voxel_size, options.fuse.truncation = session.fuse.truncation;
  options.surface.min_depth = session.min_depth, options.surface.max_depth = session.max_depth;
  return options;
}

ReadSession read_session(const fs::path& session) {
  while (true) {
    const CheckedBytes state = read_state(session);
    try {
      return read_files(session, state);
    } catch (const std::exception&) {
      // Perhaps another process has meanwhile written a newer state and removed the files of this state.
      if (read_state(session).checksum == state.checksum) throw;
    }
  }
}

SessionPictures read_pictures(const fs::path& session) {
  StateContents contents = read_contents(session, read_state(session));
  StateFile& state = contents.state;
  SessionPictures pictures{.timestamps = {},
                           .sensor = state.session.rig.sensor,
                           .keyframes = {},
                           .hold = std::move(contents.hold),
                           .hold_source_maps = {}};
  const auto source_maps = find_source_maps(session, std::move(state.files.source_maps), pictures.hold_source_maps);
  pictures.keyframes = keyframe_files(contents.files, source_maps);
  for (const Keyframe& keyframe : state.session.back_end.atlas.keyframes)
    pictures.timestamps.push_back(keyframe.timestamp);
  return pictures;
}

SessionWriter::SessionWriter(fs::path session) : session_(std::move(session)), lock_(session_) {
  // Leftovers of a run killed before its first checkpoint would change this run's name.
  if (!fs::exists(session_ / kState)) remove_runs(session_);
  remove_leftovers(session_);
  files_ = make_run();
}

fs::path SessionWriter::make_run() const {
  unsigned long last = 0;
  for (const auto& entry : fs::directory_iterator(session_))
    last = std::max(last, run_number(entry.path().filename().string()).value_or(0));
  fs::path files = session_ / fmt::format("run-{:04}", last + 1);
  std::error_code error, ignored;
  if (fs::create_directories(keyframe_files(files).folder(), error)) return files;
  fs::remove_all(files, ignored);
  throw std::runtime_error("cannot make the folder " + files.string() + ": " + error.message() +
                           "; choose another with -o");
}

SessionWriter::SessionWriter(fs::path session, const ReadSession& read, bool in_new_run)
    : session_(std::move(session)),
      lock_(session_),
      files_(in_new_run ? make_run() : read.files),
      is_referenced_(!in_new_run),
      keyframe_files_(read.keyframe_files),
      loop_files_(read.loop_files),
      source_maps_(read.source_maps) {
  if (read_state(session_).checksum != read.checksum)
    throw std::runtime_error(session_.string() + ": another run wrote into it just now; try again");
  if (in_new_run) {
    link_files(read.files, files_);
    link_files(keyframe_files(read.files).folder(), keyframe_files(files_).folder());
  }
  remove_others(read.session.number, {.run = {},
                                      .keyframe_files = names_of(read.keyframe_files),
                                      .loop_files = names_of(read.loop_files),
                                      .frame_files = read.frame_files,
                                      .source_maps = {}});
  for (const fs::path& folder : {session_, files_, keyframe_files(files_).folder()}) remove_leftovers(folder);
}

SessionWriter::~SessionWriter() {
  std::error_code ignored;
  if (!is_referenced_) fs::remove_all(files_, ignored);
}

void SessionWriter::copy_files(const SessionState& session, const NumberedFiles& submaps,
                               const NumberedFiles& keyframes) const {
  const BackEnd::State& back_end = session.back_end;
  const KeyframeStore theirs(session.rig, keyframes, Access::read), ours(session.rig, keyframe_files(files_));
  for (std::size_t k = 0; k < back_end.atlas.keyframes.size(); ++k)
    if (!keyframes[k].folder.empty()) ours.copy(k, theirs, k);
  for (std::size_t i = 0; i < back_end.submaps.size(); ++i) {
    if (!back_end.submaps[i] || submaps[i].folder.empty()) continue;
    const fs::path file = submap_file(submaps, i);
    try {
      write_whole(submap_file(submap_files(files_), i), read_whole(file, kAnySize), Durable::some_time);
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("{}: {}; the session is damaged", file.string(), error.what()));
    }
  }
}

SessionWriter::FrameFiles SessionWriter::write_frames(const FusedFrames& frames, std::uint64_t number) const {
  FrameFiles files;
  for (std::size_t i = 0; i < frames.full().size(); ++i) {
    const auto& chunk = files.chunks.emplace_back(frames.full()[i]);
    if (i < written_.chunks.size() && written_.chunks[i] == chunk) {
      files.names.push_back(written_.names[i]);
      continue;
    }
    files.names.push_back(chunk_name(kFrames, number, i));
    write_whole(files_ / files.names.back(), checked_file(json_of(*chunk), kind_of(kFrames).c_str()).bytes,
                Durable::some_time);
  }
  return files;
}

template <class T>
std::vector<ChunkFile> SessionWriter::write_chunks(const std::vector<T>& list, const char* what, std::uint64_t number,
                                                   const std::vector<ChunkFile>& written) const {
  std::vector<ChunkFile> files;
  for (std::size_t begin = 0; begin + NamedFiles::kChunk <= list.size(); begin += NamedFiles::kChunk) {
    const std::size_t i = files.size();
    const CheckedBytes file =
        checked_file(json_of(std::span(list).subspan(begin, NamedFiles::kChunk)), kind_of(what).c_str());
    if (i < written.size() && written[i].checksum == file.checksum) {
      files.push_back(written[i]);
      continue;
    }
    files.push_back({chunk_name(what, number, i), file.checksum});
    write_whole(files_ / files.back().name, file.bytes, Durable::some_time);
  }
  return files;
}

void SessionWriter::write(const SessionState& s, const BrickList& active) {
  write_bricks(active_file(files_, s.number), active);
  const Atlas& atlas = s.back_end.atlas;
  std::vector<ChunkFile> keyframes = write_chunks(atlas.keyframes, kKeyframes, s.number, keyframe_files_);
  std::vector<ChunkFile> loops = write_chunks(atlas.loops, kLoops, s.number, loop_files_);
  FrameFiles frames = write_frames(atlas.frames, s.number);
  sync_disk(files_);
  NamedFiles named{.run = files_.filename().string(),
                   .keyframe_files = names_of(keyframes),
                   .loop_files = names_of(loops),
                   .frame_files = frames.names,
                   .source_maps = source_maps_};
  for (SourceMapFiles& source : named.source_maps)
    source.folder = fs::absolute(source.folder).lexically_proximate(fs::absolute(session_));
  const CheckedBytes state = checked_file(json_of(s, named), kStateKind);
  try {
    write_whole(session_ / kState, state.bytes);
  } catch (const std::exception&) {
    // The state may exist all the same, but perhaps not after a power failure.
    is_referenced_ = is_referenced_ || has_state(session_, state.checksum);
    throw;
  }
  // From here on the new state is valid, also after a power failure.
  is_referenced_ = true;
  written_ = std::move(frames), keyframe_files_ = std::move(keyframes), loop_files_ = std::move(loops);
  remove_others(s.number, named);
}

void SessionWriter::remove_others(std::uint64_t number, const NamedFiles& named) const {
  std::error_code ignored;
  std::vector<fs::path> stale = runs_in(session_);
  std::erase(stale, files_);
  for (const auto& entry : fs::directory_iterator(files_, ignored)) {
    const std::string name = entry.path().filename().string();
    const auto is_old_chunk = [&](const char* what, const std::vector<std::string>& names) {
      return is_chunk(name, what) && std::find(names.begin(), names.end(), name) == names.end();
    };
    const bool is_old_volume = name.starts_with("active-") && entry.path() != active_file(files_, number);
    if (is_old_volume || is_old_chunk(kKeyframes, named.keyframe_files) || is_old_chunk(kLoops, named.loop_files) ||
        is_old_chunk(kFrames, named.frame_files))
      stale.push_back(entry.path());
  }
  for (const fs::path& path : stale)
    if (!fs::is_directory(path, ignored))
      fs::remove(path, ignored);
    else if (FileLock::take(path, FileLock::Kind::exclusive))  // a folder with a reader is removed at the next
                                                               // checkpoint
      fs::remove_all(path, ignored);
}

std::vector<std::uint8_t> bytes_of_state(const fs::path& session) {
  try {
    return read_whole(session / kState);
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}; {}", (session / kState).string(), error.what(), kRemedy));
  }
}

void restore_state(const fs::path& session, const std::vector<std::uint8_t>& bytes) {
  if (bytes_of_state(session) != bytes) write_whole(session / kState, bytes);
}

void remove_session(const fs::path& session, const SessionLock&) {
  fs::remove(session / kState);
  for (const fs::path& run : runs_in(session)) fs::remove_all(run);
}

}  // namespace cairn
