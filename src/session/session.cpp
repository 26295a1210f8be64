// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapping/session.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <future>
#include <stdexcept>
#include <utility>
#include <vector>

#include "base/path_kind.hpp"
#include "export/map_contents.hpp"
#include "geometry/readout.hpp"
#include "mapper/access.hpp"
#include "mapper/map_state.hpp"
#include "session/open_session.hpp"
#include "session/session_files.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// State of a mapper without its files, for a later resume. Reads the volume's residency from the device.
SessionState snapshot(MapState& s, std::uint64_t number, const std::string& note) {
  return {.rig = s.rig,
          .fuse = s.options.fuse,
          .min_depth = s.options.surface.min_depth,
          .max_depth = s.options.surface.max_depth,
          .back_end = s.back_end.save(),
          .tracker = s.tracker.save(),
          .residency = s.volume.save(),
          .fused_count = s.fused_count,
          .last_depth_hash = s.repeats.last_depth_hash,
          .repeated_images = s.repeats.count,
          .last_fused = s.last_fused,
          .number = number,
          .note = note};
}

/// Restores a mapper's state. `read` keeps the locks on its files.
std::shared_ptr<MapState> restore(ReadSession& read, const Options& options, int device, MapFiles files) {
  const SessionState& session = read.session;
  auto state = std::make_shared<MapState>(session.rig, options, Poses::tracked, device, std::move(files));
  MapState& s = *state;
  s.back_end.restore(session.back_end);
  s.tracker.restore(session.tracker);
  s.volume.restore(std::move(read.active), session.residency);
  s.fused_count = session.fused_count;
  s.repeats = {.last_depth_hash = session.last_depth_hash, .count = session.repeated_images};
  s.last_fused = session.last_fused;
  if (options.up) s.back_end.set_up_axis(*options.up);
  return state;
}

}  // namespace

std::shared_ptr<MapState> open_session(const fs::path& folder, int device) {
  const auto read = std::make_shared<ReadSession>(read_session(folder));
  return restore(*read, options_of(read->session), device,
                 {.folder = read->files, .access = Access::read, .hold = read, .source_maps = read->source_maps});
}

namespace {

/// True if a map with `map` continues with frames of `given`, whose calibration may lack parts found for the map.
bool is_continued_by(const Rig& map, const Rig& given) {
  return is_rolling(given) ? map.has_same_cameras(given) : with_global_shutter(map).has_same_cameras(given);
}

}  // namespace

class Session::State {
 public:
  State(fs::path folder, std::shared_ptr<SessionWriter> writer, std::optional<ReadSession> read)
      : folder_(std::move(folder)), writer_(std::move(writer)), read_(std::move(read)) {}
  /// Resumes the existing session.
  State(fs::path folder, bool keep_start) : folder_(std::move(folder)) { resume_run(keep_start); }
  ~State() {
    if (writing_.valid()) writing_.wait();
  }

  Mapper mapper(const Rig& rig, const Options& options, int device) {
    check(rig);
    check(options);
    if (options.esdf.live) (void)esdf_scale(options.fuse, options.esdf);
    MapFiles files{.folder = writer_->files(), .access = Access::write, .hold = writer_, .source_maps = {}};
    if (read_) files.source_maps = read_->source_maps;
    if (!read_)
      return MapperAccess::mapper_of(
          std::make_shared<MapState>(rig, options, Poses::tracked, device, std::move(files)));
    const SessionState& session = read_->session;
    if (!is_continued_by(session.rig, rig))
      throw std::runtime_error(folder_.string() + ": was made with another camera; choose another folder");
    if (session.fuse.voxel_size != options.fuse.voxel_size || session.fuse.truncation != options.fuse.truncation)
      throw std::runtime_error(fmt::format("{}: has voxels of {} m, not of {} m (FuseOptions::voxel_size)",
                                           folder_.string(), session.fuse.voxel_size, options.fuse.voxel_size));
    checkpoints_ = session.number;
    Mapper mapper = MapperAccess::mapper_of(restore(*read_, options, device, std::move(files)));
    read_.reset();
    return mapper;
  }

  Mapper mapper(int device) {
    if (!read_) throw std::runtime_error(folder_.string() + ": is a new session: pass a camera to mapper()");
    return mapper(Rig(read_->session.rig), options_of(read_->session), device);
  }

  void checkpoint(MapState& s, const std::string& note) {
    (void)problem();
    SessionState session = snapshot(s, ++checkpoints_, note);
    problem_ = s.back_end.store();
    if (problem_) return;  // the previous checkpoint stays valid
    writing_ = std::async(
        std::launch::async,
        [writer = writer_, session = std::make_unique<const SessionState>(std::move(session)),
         active = std::make_unique<const BrickList>(s.volume.list())]() mutable -> std::optional<std::string> {
          std::optional<std::string> problem;
          try {
            writer->write(*session, *active);
          } catch (const std::exception& error) {
            problem = error.what();
          }
          session.reset(), active.reset();  // the future holds this function until the next checkpoint
          malloc_trim(0);                   // returns the freed copies: the memory of a run of hours would grow
          return problem;
        });
  }

  void return_to_start() {
    (void)problem();
    if (!start_) throw std::runtime_error(folder_.string() + ": the state at the start of this run is not kept");
    problem_.reset();
    restore_state(folder_, start_->state);
    read_.reset(), writer_.reset();  // the next writer removes the files of this run
    resume_run(true);
  }

  void release_start() { start_.reset(); }

  std::optional<std::string> problem() {
    if (writing_.valid())
      if (auto problem = writing_.get()) problem_ = std::move(problem);
    return problem_;
  }

 private:
  /// Data for return_to_start(): the state file, and a lock on its run's folder.
  struct Start {
    std::vector<std::uint8_t> state;
    FileLock hold;
  };

  void resume_run(bool keep_start) {
    read_.emplace(read_session(folder_));
    writer_ = std::make_shared<SessionWriter>(folder_, *read_, keep_start);
    if (!keep_start) return;
    start_.emplace(
        Start{.state = bytes_of_state(folder_), .hold = *FileLock::take(read_->files, FileLock::Kind::shared, true)});
    read_->files = writer_->files();
  }

  fs::path folder_;
  std::shared_ptr<SessionWriter> writer_;
  std::optional<ReadSession> read_;  // until a mapper is made of the session
  std::optional<Start> start_;
  std::uint64_t checkpoints_ = 0;
  std::future<std::optional<std::string>> writing_;  // of a checkpoint; returns the error
  std::optional<std::string> problem_;               // reason why session files could not be written
};

Session::Session(std::unique_ptr<State> state) : state_(std::move(state)) {}
Session::~Session() = default;
Session::Session(Session&&) noexcept = default;
Session& Session::operator=(Session&&) noexcept = default;

Session Session::create(const fs::path& folder) {
  return Session(std::make_unique<State>(folder, std::make_shared<SessionWriter>(folder), std::nullopt));
}

Session Session::resume(const fs::path& folder, bool keep_start) {
  return Session(std::make_unique<State>(folder, keep_start));
}

Session Session::copy(const fs::path& from, const fs::path& to) {
  ReadSession read = read_session(from);
  auto writer = std::make_shared<SessionWriter>(to);
  writer->copy_files(read.session, submap_files(read.files, read.source_maps),
                     keyframe_files(read.files, read.source_maps));
  read.source_maps.clear();  // all files are in this session now
  return Session(std::make_unique<State>(to, std::move(writer), std::move(read)));
}

Mapper Session::mapper(const Rig& rig, const Options& options, int device) {
  return state_->mapper(rig, options, device);
}

Mapper Session::mapper(int device) { return state_->mapper(device); }

void Session::checkpoint(const Mapper& mapper, const std::string& note) {
  state_->checkpoint(*MapperAccess::state(mapper), note);
}

void Session::return_to_start() { state_->return_to_start(); }

void Session::release_start() { state_->release_start(); }

std::optional<std::string> Session::problem() { return state_->problem(); }

Session::Info Session::info(const fs::path& folder) {
  const SessionState session = read_session(folder).session;
  return {session.rig,       session.fuse.voxel_size, session.fuse.truncation,
          session.min_depth, session.max_depth,       session.note};
}

struct ReplacedSession::State {
  explicit State(const fs::path& f) : folder(f) {}  // Clang before 16 cannot initialize an aggregate in make_unique
  fs::path folder;
  SessionLock lock{folder};
};

ReplacedSession::ReplacedSession(const fs::path& folder) : state_(std::make_unique<State>(folder)) {}
ReplacedSession::~ReplacedSession() = default;

void ReplacedSession::remove() { remove_session(state_->folder, state_->lock); }

Map Map::open(const fs::path& folder, int device) {
  if (fs::exists(folder / "session" / "state.cbor")) return map_of(open_session(folder / "session", device));
  if (fs::exists(folder / "state.cbor")) return map_of(open_session(folder, device));
  const PathKind kind = kind_of_path(folder);
  if (fs::is_directory(folder) ? !fs::exists(folder / "map.vdb") : kind.kind == PathKind::Kind::mesh)
    throw std::runtime_error(kind.mismatch(folder, "map with voxels"));
  return map_of_grids(fs::is_directory(folder) ? folder / "map.vdb" : folder, device);
}

}  // namespace cairn
