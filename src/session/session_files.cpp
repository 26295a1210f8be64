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
#include <iterator>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "base/json_text.hpp"
#include "cairn/atomic_file.hpp"
#include "session/checked_file.hpp"
#include "session/state.hpp"
#include "session/validate.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr const char* kStateKind = "cairn session";
constexpr const char* kFramesKind = "cairn frames";
constexpr const char* kState = "state.cbor";
constexpr const char* kKeyframes = "keyframes";
constexpr const char* kAgain = "begin a new session";

fs::path active_file(const fs::path& files, std::uint64_t number) {
  return files / fmt::format("active-{:06}.vdb", number);
}

bool is_frames(std::string_view name) {
  return name.starts_with("frames-") && name.ends_with(".cbor") && name.find('/') == std::string_view::npos;
}

CheckedBytes read_state(const fs::path& session) {
  const fs::path file = session / kState;
  if (!fs::exists(file))
    throw std::runtime_error(file.string() + ": there is no session to go on with; begin a new session");
  try {
    return read_checked(file, kStateKind);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}; {}", error.what(), kAgain));
  }
}

/// Brings all files of the disk that a folder is on to it: of keyframes there are many, and to wait for each costs
/// more.
void sync_disk(const fs::path& folder) {
  const int descriptor = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = descriptor >= 0 && syncfs(descriptor) == 0;
  const int error = errno;
  if (descriptor >= 0) close(descriptor);
  if (!synced) throw std::runtime_error("cannot write " + folder.string() + ": " + std::strerror(error));
}

/// Whether the session has a state with this checksum.
bool names(const fs::path& session, std::uint32_t checksum) {
  try {
    return read_state(session).checksum == checksum;
  } catch (const std::exception&) {
    return false;
  }
}

/// With its newest frames; those of files are still to be read.
StateFile parse_state(const CheckedBytes& read) {
  StateFile state = state_of(parse_cbor(read.bytes), read.format);
  for (const std::string& name : state.frame_files)
    if (!is_frames(name)) throw std::runtime_error("frames are missing");
  validate(state.session, FusedFrames::kChunk * state.frame_files.size() + state.session.back_end.atlas.frames.size());
  return state;
}

FusedFrames read_frames(const fs::path& files, const std::vector<std::string>& names, const Atlas& atlas) {
  FusedFrames frames;
  for (const std::string& name : names) {
    const fs::path file = files / name;
    const CheckedBytes read = read_checked(file, kFramesKind);
    try {
      auto chunk = frames_of(parse_cbor(read.bytes), read.format);
      validate(chunk, atlas.keyframes.size());
      if (chunk.size() != FusedFrames::kChunk) throw std::runtime_error("frames are missing");
      frames.push_back(std::make_shared<const FusedFrames::Chunk>(std::move(chunk)));
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("{}: is damaged ({})", file.string(), plain(error.what())));
    }
  }
  for (const FusedFrame& frame : atlas.frames.rest()) frames.push_back(frame);
  return frames;
}

/// What a state names; throws what is wrong with it or with the files, and what to do.
ReadSession read_files(const fs::path& session, const CheckedBytes& bytes) {
  StateFile state;
  try {
    state = parse_state(bytes);
  } catch (const std::exception& error) {
    throw std::runtime_error(
        fmt::format("{}: is damaged ({}); {}", (session / kState).string(), plain(error.what()), kAgain));
  }
  SessionState& s = state.session;
  const fs::path files = session / s.run;
  if (!fs::is_directory(files))
    throw std::runtime_error(files.string() + ": is missing; the session is damaged: " + kAgain);
  auto hold = FileLock::take(files, FileLock::Kind::shared, true);
  try {
    BrickTree active = BrickFile(active_file(files, s.number)).read();
    s.back_end.atlas.frames = read_frames(files, state.frame_files, s.back_end.atlas);
    return {std::move(s), std::move(active), files, bytes.checksum, std::move(*hold), std::move(state.frame_files)};
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string(error.what()) + "; the session is damaged: " + kAgain);
  }
}

/// Beside state.cbor and the lock, what cairn writes into a session's folder: in this format and in the one before.
bool is_ours(const std::string& name) {
  return run_number(name) || name == kKeyframes ||
         ((name.starts_with("submap-") || name.starts_with("active-")) && name.ends_with(".vdb"));
}

}  // namespace

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
      // Perhaps somebody has written a newer state meanwhile, and removed what this one names.
      if (read_state(session).checksum == state.checksum) throw;
    }
  }
}

SessionPictures read_pictures(const fs::path& session) {
  const StateFile state = parse_state(read_state(session));
  const fs::path files = session / state.session.run;
  if (!fs::is_directory(files))
    throw std::runtime_error(files.string() + ": is missing; the session is damaged: " + kAgain);
  SessionPictures pictures{.sensor = state.session.rig.sensor,
                           .keyframes = files / kKeyframes,
                           .hold = *FileLock::take(files, FileLock::Kind::shared, true)};
  for (const Keyframe& keyframe : state.session.back_end.atlas.keyframes)
    pictures.timestamps.push_back(keyframe.timestamp);
  return pictures;
}

SessionWriter::SessionWriter(fs::path session) : session_(std::move(session)), lock_(session_) {
  unsigned long last = 0;
  for (const auto& entry : fs::directory_iterator(session_))
    last = std::max(last, run_number(entry.path().filename().string()).value_or(0));
  remove_leftovers(session_);
  files_ = session_ / fmt::format("run-{:04}", last + 1);
  std::error_code error, ignored;
  if (fs::create_directories(files_ / kKeyframes, error)) return;
  fs::remove_all(files_, ignored);
  throw std::runtime_error("cannot make the folder " + files_.string() + ": " + error.message() +
                           "; choose another with -o");
}

SessionWriter::SessionWriter(fs::path session, const ReadSession& read)
    : session_(std::move(session)), lock_(session_), files_(read.files), is_named_(true) {
  if (read_state(session_).checksum != read.checksum)
    throw std::runtime_error(session_.string() + ": another run wrote into it just now; try again");
  remove_others(read.session.number, read.frame_files);
  for (const fs::path& folder : {session_, files_, files_ / kKeyframes}) remove_leftovers(folder);
}

SessionWriter::~SessionWriter() {
  std::error_code ignored;
  if (!is_named_) fs::remove_all(files_, ignored);
}

void SessionWriter::copy_files(const ReadSession& from) const {
  const auto copy = [&](const fs::path& name) {
    std::ifstream in(from.files / name, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    if (!in) throw std::runtime_error((from.files / name).string() + ": cannot be read; the session is damaged");
    write_whole(files_ / name, bytes, Durable::some_time);
  };
  for (const auto& entry : fs::directory_iterator(from.files))
    if (const fs::path name = entry.path().filename(); name.string().starts_with("submap-")) copy(name);
  for (const auto& entry : fs::directory_iterator(from.files / kKeyframes))
    if (const fs::path name = entry.path().filename(); name.string()[0] != '.') copy(kKeyframes / name);
}

SessionWriter::FrameFiles SessionWriter::write_frames(const FusedFrames& frames, std::uint64_t number) const {
  FrameFiles files;
  for (std::size_t i = 0; i < frames.full().size(); ++i) {
    const auto& chunk = files.chunks.emplace_back(frames.full()[i]);
    if (i < written_.chunks.size() && written_.chunks[i] == chunk) {
      files.names.push_back(written_.names[i]);
      continue;
    }
    files.names.push_back(fmt::format("frames-{:06}-{:06}.cbor", number, i));
    write_whole(files_ / files.names.back(), checked_file(json_of(*chunk), kFramesKind).bytes, Durable::some_time);
  }
  return files;
}

void SessionWriter::write(const SessionState& s, const BrickTree& active) {
  write_bricks(active_file(files_, s.number), active);
  FrameFiles frames = write_frames(s.back_end.atlas.frames, s.number);
  sync_disk(files_);
  const CheckedBytes state = checked_file(json_of(s, files_.filename().string(), frames.names), kStateKind);
  try {
    write_whole(session_ / kState, state.bytes);
  } catch (const std::exception&) {
    // It may be there all the same, but perhaps not after a power cut.
    is_named_ = is_named_ || names(session_, state.checksum);
    throw;
  }
  // From here on the new state counts, also after a power cut.
  is_named_ = true;
  written_ = std::move(frames);
  remove_others(s.number, written_.names);
}

void SessionWriter::remove_others(std::uint64_t number, const std::vector<std::string>& frame_files) const {
  std::vector<fs::path> stale;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(session_, ignored))
    if (is_ours(entry.path().filename().string()) && entry.path() != files_) stale.push_back(entry.path());
  for (const auto& entry : fs::directory_iterator(files_, ignored)) {
    const std::string name = entry.path().filename().string();
    const bool is_old =
        name.starts_with("active-")
            ? entry.path() != active_file(files_, number)
            : is_frames(name) && std::find(frame_files.begin(), frame_files.end(), name) == frame_files.end();
    if (is_old) stale.push_back(entry.path());
  }
  for (const fs::path& path : stale)
    if (!fs::is_directory(path, ignored))
      fs::remove(path, ignored);
    else if (FileLock::take(path, FileLock::Kind::exclusive))  // what somebody reads goes with the next checkpoint
      fs::remove_all(path, ignored);
}

void remove_session(const fs::path& session, const SessionLock&) {
  fs::remove(session / kState);
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(session))
    if (is_ours(entry.path().filename().string())) stale.push_back(entry.path());
  for (const fs::path& path : stale) fs::remove_all(path);
}

}  // namespace cairn
