// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/mapper.hpp"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <future>
#include <limits>
#include <set>
#include <stdexcept>
#include <string_view>
#include <tuple>

#include "base/newest.hpp"
#include "base/stopwatch.hpp"
#include "export/export.hpp"
#include "export/graph_picture.hpp"
#include "map/back_end.hpp"
#include "map/growing_surface.hpp"
#include "map/refine.hpp"
#include "map/tracker.hpp"
#include "session/session.hpp"
#include "surface/preprocess.hpp"
#include "volume/esdf.hpp"
#include "volume/integrate.hpp"
#include "volume/polygonize.hpp"

namespace cairn {
namespace {

constexpr int kMaxRepeats = 2;
constexpr std::uint64_t kWorldPool = std::uint64_t{256} << 20;  // bytes on the device while the whole map is meshed

constexpr double kEnoughDepth = 0.2;  // of the image, to begin a piece with
constexpr double kLeastDepth = 0.02;  // of the image, to begin the map with

std::string in_metres(float length) {
  std::string text = std::to_string(length);
  text.erase(text.find_last_not_of('0') + 1);
  return text.back() == '.' ? text + '0' : text;
}

constexpr double kRigid = 1e-3;         // of a rotation times its own transpose, beside the identity
constexpr double kFarthestVoxel = 4e6;  // from the origin: single precision still tells neighbouring voxels apart

std::string unusable(const Frame& frame, const Camera& camera, std::optional<double> before) {
  const auto pixels = static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  if (!frame.problem.empty()) return frame.problem;
  if (frame.depth.empty() || frame.depth.size() != pixels) return "the depth image is not of the camera's size";
  float least = frame.depth[0], most = least;
  bool is_depth = true;
  for (const float z : frame.depth) {
    least = std::min(least, z), most = std::max(most, z);
    is_depth &= z >= 0 && z <= std::numeric_limits<float>::max();
  }
  if (!is_depth) return "a depth is negative or no number: 0 stands for no measurement";
  if (least > 0 && least == most) return "every depth is the same: the sensor shows nothing";
  if (!std::isfinite(frame.timestamp)) return "the timestamp is not a number";
  if (before && frame.timestamp <= *before) return "the timestamp goes back";
  return {};
}

/// Why nothing can be fused at a pose that was given.
std::string unusable(const std::optional<Eigen::Isometry3d>& world_from_camera, float voxel_size) {
  if (!world_from_camera) return "no pose is given for this time";
  const Eigen::Matrix3d turn = world_from_camera->linear();
  if (!world_from_camera->matrix().allFinite() || !(turn * turn.transpose()).isIdentity(kRigid) ||
      turn.determinant() < 0)
    return "the given pose is no rotation and translation";
  if (world_from_camera->translation().norm() > kFarthestVoxel * static_cast<double>(voxel_size))
    return "the given pose is too far from the origin for voxels of this size";
  return {};
}

/// The frame without what of it cannot be used beside the depth image, and why.
struct Usable {
  explicit Usable(const Frame& given) : frame_(given) {
    const auto drop = [&](const char* reason, const auto& what) {
      if (!mended_) mended_ = given;
      what(*mended_);
      why_ += (why_.empty() ? "" : "; ") + std::string(reason);
    };
    if (!given.colour.empty() && given.colour.size() != given.depth.size())
      drop("its colour image is not of the camera's size: depth alone is used", [](Frame& f) { f.colour.clear(); });
    if (!std::isfinite(given.colour_delay))
      drop("the colour image's time is not a number: depth alone is used", [](Frame& f) {
        f.colour.clear();
        f.colour_delay = 0;
      });
    if (given.acceleration && !given.acceleration->allFinite())
      drop("its acceleration is not a number: it is left out", [](Frame& f) { f.acceleration.reset(); });
  }
  [[nodiscard]] const Frame& frame() const { return mended_ ? *mended_ : frame_; }
  [[nodiscard]] const std::string& why() const { return why_; }

 private:
  const Frame& frame_;
  std::optional<Frame> mended_;
  std::string why_;
};

/// The first camera's pose in a world whose y axis points down.
Eigen::Isometry3d level(const std::optional<Eigen::Vector3d>& acceleration) {
  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  if (acceleration && acceleration->norm() > 0)
    world_from_camera.linear() =
        Eigen::Quaterniond::FromTwoVectors(*acceleration, -Eigen::Vector3d::UnitY()).toRotationMatrix();
  return world_from_camera;
}

void tell(const Tracked& tracked, FrameReport& report) {
  const Alignment& a = tracked.alignment;
  report.guess = tracked.guess;
  report.inlier_share = a.inlier_share;
  report.overlap = a.overlap;
  report.rmse = a.rmse;
  report.photometric_share = a.photometric_share;
  report.photometric_rmse = a.photometric_rmse;
  report.degenerate_directions = a.degenerate_directions;
  report.unobserved = a.unobserved;
  report.iterations = a.iterations;
}

/// Options for the part of the mapper that has its files in a run's folder.
Options with_files(Options options, const std::filesystem::path& files) {
  options.session = files;
  return options;
}

}  // namespace

struct Mapper::State {
  /// `files`: the run's folder, which `w` may write into; empty: all stays in memory.
  State(const Camera& c, const Options& o, Poses p, int device_index, std::unique_ptr<SessionWriter> w = {},
        const std::filesystem::path& files = {})
      : options(o),
        poses(p),
        camera(c),
        device(device_index),
        preprocessor(device, c, o.surface, o.track.levels, o.track.finest_level),
        integrator(device, preprocessor.camera(), o.surface),
        polygonizer(device),
        volume(device, o.fuse, o.surface.max_depth),
        writer(std::move(w)),
        back_end(device, c, with_files(o, files), writer ? Access::write : Access::read),
        tracker(device, c, preprocessor.camera(), o, back_end.places()),
        given_images(c, {}) {}

  [[nodiscard]] Warnings& warnings() { return back_end.warnings(); }

  /// With given poses keyframes are only for textures.
  void keep_keyframe(const Frame& frame, const Eigen::Isometry3d& world_from_camera) {
    if (!options.keep_keyframes ||
        (!given_keyframes.empty() &&
         !is_apart(given[given_keyframes.back().first].world_from_camera, world_from_camera)))
      return;
    given_images.put(given_keyframes.size(), frame, {});
    given_keyframes.emplace_back(given.size(), frame.colour_delay);
  }

  /// Keyframes of the main piece, as textures need them.
  std::vector<TextureKeyframe> texture_keyframes() const {
    constexpr double kMaxGap = 0.2;  // seconds between frames that tell the camera's velocity
    const auto velocity = [&](const auto& frames, std::size_t i, const auto& pose) -> Vector6d {
      const std::size_t a = i > 0 ? i - 1 : i, b = i + 1 < frames.size() ? i + 1 : i;
      const double seconds = frames[b].timestamp - frames[a].timestamp;
      if (!(seconds > 0 && seconds < kMaxGap)) return Vector6d::Zero();
      return local_coordinates(pose(a).inverse() * pose(b)) / seconds;
    };
    std::vector<TextureKeyframe> keyframes;
    if (poses == Poses::given) {
      for (std::size_t k = 0; k < given_keyframes.size(); ++k) {
        const auto [i, delay] = given_keyframes[k];
        keyframes.push_back({.image = k,
                             .world_from_camera = given[i].world_from_camera,
                             .velocity = velocity(given, i, [&](std::size_t j) { return given[j].world_from_camera; }),
                             .colour_delay = delay});
      }
      return keyframes;
    }
    const Atlas& atlas = back_end.atlas();
    const auto component_of = atlas.components();
    const std::size_t main = atlas.keyframes.empty() ? 0 : atlas.main_component();
    for (std::size_t i = 0; i < atlas.frames.size(); ++i) {
      const std::size_t k = atlas.frames[i].keyframe;
      if (component_of[k] != main || (i > 0 && atlas.frames[i - 1].keyframe == k)) continue;
      keyframes.push_back(
          {.image = k,
           .world_from_camera = atlas.world_from_camera[k],
           .velocity =
               velocity(atlas.frames, i, [&](std::size_t j) { return atlas.submap_from_camera(atlas.frames[j]); }),
           .colour_delay = atlas.keyframes[k].colour_delay - tracker.clock_offset()});
    }
    return keyframes;
  }

  /// Noise never repeats. A driver may deliver one image twice, but not more often.
  bool is_stuck(const Frame& frame) {
    const std::size_t image = std::hash<std::string_view>()(
        {reinterpret_cast<const char*>(frame.depth.data()), frame.depth.size() * sizeof(float)});
    repeats = image == last_image ? repeats + 1 : 0;
    last_image = image;
    return repeats > kMaxRepeats;
  }

  /// Whether the camera has been lost for long enough and this frame shows something.
  bool may_begin_piece(const Frame& frame) {
    const auto seen = std::count_if(frame.depth.begin(), frame.depth.end(), [](float z) { return z > 0; });
    lost += static_cast<double>(seen) > kEnoughDepth * static_cast<double>(frame.depth.size());
    return lost >= options.map.lost_frames;
  }

  /// Whether there is as much depth as alignment asks for.
  bool can_begin_map(const Frame& frame) const {
    const auto seen = std::count_if(frame.depth.begin(), frame.depth.end(), [this](float z) {
      return z >= options.surface.min_depth && z <= options.surface.max_depth;
    });
    return static_cast<double>(seen) >= kLeastDepth * static_cast<double>(frame.depth.size());
  }

  /// The live distance field follows what a frame changed; without one it starts with all that the volume holds. Where
  /// it cannot it ends: an old one would tell of free space that is none.
  void follow_distances(const Fused& fused, StageTimes& times) {
    options.esdf.live = warnings().attempt("there is no distance field from here on", [&] {
      timed(times, "esdf", [&] {
        std::vector<Brick> changed = fused.changed;
        changed.insert(changed.end(), fused.newly_free.begin(), fused.newly_free.end());
        if (!esdf) {
          esdf.emplace(device, options.fuse, options.esdf);
          changed = volume.bricks();
          const std::vector<Brick> free = volume.host().free_bricks();
          changed.insert(changed.end(), free.begin(), free.end());
        }
        return esdf->update(volume, changed);
      });
      live_distances.put(timed(times, "esdf to host", [&] { return esdf->field(); }));
    });
    if (options.esdf.live) return;
    esdf.reset();
    live_distances.put({});
  }

  /// All of the map goes to submaps.
  void end_everything() {
    back_end.settle();
    back_end.end_submap(volume, fused_count, false);
    whole.reset();
  }

  /// How much of the device the whole map may take while it is looked at beside the volume.
  FuseOptions world_pool() const {
    FuseOptions pool = options.fuse;
    pool.device_memory = std::min(pool.device_memory != 0 ? pool.device_memory : kWorldPool, kWorldPool);
    return pool;
  }

  /// The volume of the whole map.
  Volume& world() {
    if (poses == Poses::given) return volume;
    back_end.settle();
    if (back_end.is_plain()) return volume;
    if (!whole) {
      back_end.end_submap(volume, fused_count, true);
      whole.emplace(device, world_pool(), options.surface.max_depth);
      whole->adopt(back_end.world().release());
    }
    return *whole;
  }

  Options options;
  Poses poses;
  Camera camera;
  gpu::Device device;
  Preprocessor preprocessor;
  Integrator integrator;
  Polygonizer polygonizer;
  Volume volume;
  std::unique_ptr<SessionWriter> writer;  // of Options::session; none: the session is only looked at
  std::optional<FileLock> hold;           // then
  BackEnd back_end;
  Tracker tracker;
  std::optional<GrowingSurface> surface;  // once it is asked for
  bool shows_surface = true;              // it could be made so far
  std::optional<Esdf> esdf;               // with EsdfOptions::live
  Newest<DistanceField> live_distances;
  std::optional<Volume> whole;                                  // the world, where that is not what `volume` holds
  Trajectory given;                                             // with Poses::given
  KeyframeStore given_images;                                   // then, with Options::keep_keyframes
  std::vector<std::pair<std::size_t, double>> given_keyframes;  // of `given`; the colour images' delays
  std::optional<double> last_fused;                             // timestamp
  int lost = 0;                                                 // frames that saw something, since the last fused one
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();       // sum over fused frames, in the world
  std::uint32_t fused_count = 0;                                // fused frames
  std::uint64_t checkpoints = 0;
  std::future<std::string> writing;  // of a checkpoint; what went wrong
  std::string problem;               // why session files could not be written
  std::size_t last_image = 0;        // hash of the last frame's depth
  int repeats = 0;                   // frames since that image was new
};

Mapper::Mapper(const Camera& camera, const Options& options, Poses poses, int device) {
  check(camera);
  check(options);
  if (options.esdf.live) (void)esdf_scale(options.fuse, options.esdf);
  if (options.session.empty() || poses == Poses::given) {
    state_ = std::make_unique<State>(camera, options, poses, device);
  } else {
    auto writer = std::make_unique<SessionWriter>(options.session);
    const std::filesystem::path files = writer->files();
    state_ = std::make_unique<State>(camera, options, poses, device, std::move(writer), files);
  }
}
Mapper::Mapper(std::unique_ptr<State> state) : state_(std::move(state)) {}
Mapper::~Mapper() = default;
Mapper::Mapper(Mapper&&) noexcept = default;

FrameReport Mapper::add(const Frame& given) {
  State& s = *state_;
  FrameReport report{
      .index = given.index, .timestamp = given.timestamp, .reason = unusable(given, s.camera, s.last_fused)};
  if (report.reason.empty() && s.poses == Poses::given)
    report.reason = unusable(given.world_from_camera, s.options.fuse.voxel_size);
  if (!report.reason.empty()) return report;
  const Usable usable(given);
  const Frame& frame = usable.frame();

  if (s.poses == Poses::tracked && s.is_stuck(frame)) {
    report.reason = "the depth image repeats: the sensor is stuck";
    return report;
  }

  const Surface live = timed(report.stage_ms, "preprocess", [&] { return s.preprocessor.preprocess(frame); });

  Eigen::Isometry3d world_from_camera = Eigen::Isometry3d::Identity();
  std::optional<Tracked> tracked;
  if (s.poses == Poses::given) {
    world_from_camera = *frame.world_from_camera;
  } else if (s.back_end.atlas().frames.empty()) {
    if (!s.can_begin_map(frame)) {
      report.reason = "too little depth between " + in_metres(s.options.surface.min_depth) + " and " +
                      in_metres(s.options.surface.max_depth) + " m to begin the map with";
      return report;
    }
    world_from_camera = level(frame.acceleration);
  } else {
    tracked = s.tracker(frame, live, s.volume, report.stage_ms);
    const Alignment& alignment = tracked->alignment;
    tell(*tracked, report);
    if (alignment.converged()) {
      world_from_camera = alignment.submap_from_camera;
      report.moving =
          timed(report.stage_ms, "track", [&] { return s.tracker.leave_out_moving(live, *tracked, s.volume); });
    } else {
      s.tracker.reject();
      if (!s.may_begin_piece(frame)) {
        report.state = FrameState::lost;
        report.reason = alignment.lost;
        return report;
      }
      s.back_end.end_submap(s.volume, s.fused_count, false);
      s.tracker.restart();
      s.esdf.reset();
      if (s.surface) s.surface.emplace();
      tracked.reset();
      world_from_camera = level(frame.acceleration);
      report.reason = "not found again: begins a new piece of the map";
    }
  }

  const Fused fused = timed(report.stage_ms, "fuse",
                            [&] { return s.integrator.integrate(live, world_from_camera, s.volume, ++s.fused_count); });
  report.touched_bricks = fused.touched;
  report.new_bricks = fused.new_bricks;
  report.state = FrameState::fused;
  if (!usable.why().empty()) report.reason = usable.why();
  if (s.poses == Poses::tracked) {
    s.tracker.accept(frame, live, world_from_camera, tracked ? &*tracked : nullptr);
    const bool is_keyframe = timed(report.stage_ms, "keyframe", [&] {
      return s.back_end.add(frame, world_from_camera, tracked ? &tracked->alignment.information : nullptr, s.volume,
                            s.fused_count);
    });
    if (is_keyframe) s.warnings().attempt("the focal length is not checked", [&] { s.tracker.learn_from_places(); });
  } else {
    s.keep_keyframe(frame, world_from_camera);
    s.given.push_back({frame.timestamp, world_from_camera});
  }
  if (frame.acceleration) s.acceleration += world_from_camera.linear() * *frame.acceleration;
  if (s.options.esdf.live) s.follow_distances(fused, report.stage_ms);
  if (s.surface) s.surface->change(fused.changed);
  s.last_fused = frame.timestamp;
  s.lost = 0;
  s.whole.reset();
  return report;
}

int Mapper::recordings() const { return 1 + static_cast<int>(state_->back_end.atlas().recordings.size()); }

Trajectory Mapper::trajectory(int recording) const {
  if (state_->poses == Poses::given) return state_->given;
  const Atlas& atlas = state_->back_end.atlas();
  const auto number = static_cast<std::size_t>(recording < 0 ? recordings() - 1 : recording);
  const std::size_t begin = number == 0 ? 0 : atlas.recordings.at(number - 1);
  const std::size_t end = number < atlas.recordings.size() ? atlas.recordings[number] : atlas.frames.size();
  Trajectory trajectory = atlas.trajectory(atlas.main_component(), begin, end);
  for (StampedPose& pose : trajectory) pose.timestamp += state_->tracker.clock_offset();
  return trajectory;
}

Trajectory Mapper::path(std::size_t points) const {
  const State& s = *state_;
  const Atlas& atlas = s.back_end.atlas();
  const auto step_of = [&](std::size_t frames) { return frames / std::max<std::size_t>(1, points - 1) + 1; };
  Trajectory path;
  if (s.poses == Poses::tracked) {
    const std::size_t begin = atlas.recordings.empty() ? 0 : atlas.recordings.back(), end = atlas.frames.size();
    path = atlas.trajectory(atlas.main_component(), begin, end, step_of(end - begin));
    for (StampedPose& pose : path) pose.timestamp += s.tracker.clock_offset();
  } else if (!s.given.empty()) {
    for (std::size_t i = 0; i + 1 < s.given.size(); i += step_of(s.given.size())) path.push_back(s.given[i]);
    path.push_back(s.given.back());
  }
  return path;
}

const std::vector<std::string>& Mapper::warnings() const { return state_->warnings().all(); }

Refined Mapper::refine() {
  state_->whole.reset();
  Refined refined;
  state_->warnings().attempt("poses stay as they are", [&] { refined = cairn::refine(state_->back_end); });
  return refined;
}

void Mapper::reintegrate(Source& again, const std::function<void()>& step) {
  State& s = *state_;
  s.back_end.settle();
  const Atlas& atlas = s.back_end.atlas();
  const Trajectory poses =
      s.poses == Poses::given ? s.given : atlas.trajectory(atlas.main_component(), 0, atlas.frames.size());
  s.whole.reset();
  const Volume::Residency residency = s.volume.residency();
  BrickTree before = s.volume.on_host().copy();
  const Eigen::Vector3d acceleration = s.acceleration;
  const bool is_done = s.warnings().attempt("frames are not fused again", [&] {
    if (recordings() > 1) throw std::runtime_error("the map is made of several recordings");
    s.volume.adopt({});
    s.acceleration.setZero();
    const std::uint32_t since = s.fused_count + 1;
    while (const auto next = again.next()) {
      const auto pose =
          unusable(*next, s.camera, std::nullopt).empty() ? pose_at(poses, next->timestamp, 0) : std::nullopt;
      if (pose) {
        const Usable usable(*next);
        const Frame& frame = usable.frame();
        (void)s.integrator.integrate(s.preprocessor.preprocess(frame), *pose, s.volume, ++s.fused_count);
        if (frame.acceleration) s.acceleration += pose->linear() * *frame.acceleration;
      }
      if (step) step();
    }
    if (s.poses == Poses::tracked) s.back_end.rebase(since);
  });
  if (is_done) return;
  s.volume.restore(std::move(before), residency);
  s.acceleration = acceleration;
}

std::vector<std::pair<double, int>> Mapper::keyframes() const {
  std::vector<std::pair<double, int>> keyframes;
  for (const Keyframe& keyframe : state_->back_end.atlas().keyframes)
    keyframes.emplace_back(keyframe.timestamp, static_cast<int>(keyframe.searched));
  return keyframes;
}

std::vector<FoundLoop> Mapper::loops() const {
  const Atlas& atlas = state_->back_end.atlas();
  std::vector<FoundLoop> loops;
  for (const Loop& loop : atlas.loops)
    if (loop.corners > 0)
      loops.push_back({.from = atlas.keyframes[loop.edge.i].timestamp,
                       .to = atlas.keyframes[loop.edge.j].timestamp,
                       .i_from_j = loop.edge.i_from_j,
                       .corners = loop.corners,
                       .inlier_share = loop.inlier_share,
                       .rmse = loop.rmse,
                       .inlier = loop.inlier});
  return loops;
}

void Mapper::write_graph(const std::filesystem::path& file) const {
  if (file.extension() == ".svg")
    write_graph_picture(file, state_->back_end.atlas());
  else
    write_g2o(file, state_->back_end.atlas().graph());
}

void Mapper::checkpoint(const std::string& note) {
  State& s = *state_;
  if (!s.writer) return;
  (void)session_problem();
  Session session{.camera = s.camera,
                  .fuse = s.options.fuse,
                  .min_depth = s.options.surface.min_depth,
                  .max_depth = s.options.surface.max_depth,
                  .back_end = s.back_end.memory(),
                  .tracker = s.tracker.memory(),
                  .keyframe = s.tracker.keyframe().save(),
                  .residency = s.volume.residency(),
                  .fused_count = s.fused_count,
                  .last_image = s.last_image,
                  .repeats = s.repeats,
                  .lost = s.lost,
                  .last_fused = s.last_fused,
                  .acceleration = s.acceleration,
                  .number = ++s.checkpoints,
                  .run = {},
                  .note = note};
  s.problem = s.back_end.store();
  if (!s.problem.empty()) return;  // the checkpoint before still holds
  s.writing = std::async(
      std::launch::async,
      [&writer = *s.writer, session = std::make_unique<const Session>(std::move(session)),
       active = std::make_unique<const BrickTree>(s.volume.on_host().copy())]() mutable -> std::string {
        std::string problem;
        try {
          writer.write(*session, *active);
        } catch (const std::exception& error) {
          problem = error.what();
        }
        session.reset(), active.reset();  // the future that holds this function lives until the next checkpoint
        malloc_trim(0);                   // a run of hours would creep by what is left of such copies
        return problem;
      });
}

std::string Mapper::session_problem() const {
  if (state_->writing.valid())
    if (std::string problem = state_->writing.get(); !problem.empty()) state_->problem = problem;
  return state_->problem;
}

Mapper::SessionInfo Mapper::session_info(const std::filesystem::path& folder) {
  const Session session = read_session(folder).session;
  return {session.camera,    session.fuse.voxel_size, session.fuse.truncation,
          session.min_depth, session.max_depth,       session.note};
}

/// Goes on with what was read. Without a writer it is only looked at.
std::unique_ptr<Mapper::State> Mapper::restore(ReadSession read, const Options& options, int device,
                                               std::unique_ptr<SessionWriter> writer) {
  const Session& session = read.session;
  const std::filesystem::path files = writer ? writer->files() : read.files;
  auto state = std::make_unique<State>(session.camera, options, Poses::tracked, device, std::move(writer), files);
  State& s = *state;
  s.hold.emplace(std::move(read.hold));
  s.back_end.restore(session.back_end);
  s.tracker.restore(session.tracker, session.keyframe);
  s.volume.restore(std::move(read.active), session.residency);
  s.fused_count = session.fused_count;
  s.last_image = session.last_image;
  s.repeats = session.repeats;
  s.lost = session.lost;
  s.last_fused = session.last_fused;
  s.acceleration = session.acceleration;
  s.checkpoints = session.number;
  return state;
}

Mapper Mapper::open(const std::filesystem::path& folder, int device) {
  ReadSession read = read_session(folder);
  const Options options = options_of(read.session);
  return Mapper(restore(std::move(read), options, device, nullptr));
}

Mapper Mapper::copy(const std::filesystem::path& folder, const std::filesystem::path& to, int device) {
  ReadSession read = read_session(folder);
  Options options = options_of(read.session);
  options.session = to;
  auto writer = std::make_unique<SessionWriter>(to);
  writer->copy_files(read);
  return Mapper(restore(std::move(read), options, device, std::move(writer)));
}

Mapper Mapper::resume(const Camera& camera, const Options& options, int device) {
  check(options);
  if (options.esdf.live) (void)esdf_scale(options.fuse, options.esdf);
  ReadSession read = read_session(options.session);
  const Session& session = read.session;
  if (session.camera != camera)
    throw std::runtime_error(options.session.string() + ": was made with another camera; choose another folder");
  if (session.fuse.voxel_size != options.fuse.voxel_size || session.fuse.truncation != options.fuse.truncation)
    throw std::runtime_error(options.session.string() + ": has voxels of " + std::to_string(session.fuse.voxel_size) +
                             " m; give the same --voxel-size");
  auto writer = std::make_unique<SessionWriter>(options.session, read);
  return Mapper(restore(std::move(read), options, device, std::move(writer)));
}

void Mapper::begin_recording() {
  State& s = *state_;
  s.last_fused.reset();
  if (s.back_end.atlas().frames.empty()) return;
  s.end_everything();
  s.volume.adopt(s.back_end.world().release());
  s.back_end.begin_in_world();
  s.tracker.begin_lost();
  s.lost = 0;
  s.esdf.reset();
  if (s.surface) s.surface.emplace();
}

Mapper::Merged Mapper::merge(Mapper& other) {
  State &s = *state_, &o = *other.state_;
  if (&s == &o) throw std::runtime_error("a map cannot be merged with itself");
  if (!s.writer || !o.back_end.images().in_files())
    throw std::runtime_error("a map without a folder for its session cannot be merged: it has no session to take");
  if (s.camera != o.camera) throw std::runtime_error("maps cannot be merged: one was made with another camera");
  if (s.options.fuse.voxel_size != o.options.fuse.voxel_size || s.options.fuse.truncation != o.options.fuse.truncation)
    throw std::runtime_error("maps cannot be merged: one has voxels of another size or another truncation");
  s.end_everything();
  o.end_everything();
  Merged merged{.compared = static_cast<int>(o.back_end.atlas().keyframes.size())};
  std::tie(merged.loops, merged.joined) = s.back_end.append(o.back_end);
  s.acceleration += o.acceleration;
  s.fused_count += o.fused_count;
  return merged;
}

void Mapper::settle() { state_->back_end.settle(); }

Mesh Mapper::mesh() { return state_->polygonizer.polygonize(state_->world()); }

Exported Mapper::export_mesh(const std::filesystem::path& file, const ExportOptions& options,
                             const ExportProgress& progress) {
  State& s = *state_;
  check(options, file);
  const KeyframeStore& images = s.poses == Poses::given ? s.given_images : s.back_end.images();
  images.wait();
  // A world that lies otherwise than it was fused is made part by part, so that it may be larger than the memory.
  s.back_end.settle();
  const bool in_parts = s.poses == Poses::tracked && !s.back_end.is_plain();
  std::optional<WorldParts> parts;
  std::optional<Volume> part;
  if (in_parts) {
    s.whole.reset();
    s.back_end.end_submap(s.volume, s.fused_count, true);
    parts.emplace(s.back_end.world_parts(s.device));
    part.emplace(s.device, s.world_pool(), s.options.surface.max_depth);
  }
  ExportInput input{.bricks = in_parts ? parts->bricks() : s.volume.bricks(),
                    .volume = in_parts ? *part : s.volume,
                    .load = {},
                    .polygonizer = s.polygonizer,
                    .camera = s.camera,
                    .surface = s.options.surface,
                    .keyframes = s.texture_keyframes(),
                    .get_image = [&](std::size_t image) { return images.get(image); },
                    .paths = {}};
  if (in_parts)
    input.load = [&](std::span<const Brick> bricks) { part->adopt(parts->make(bricks, s.back_end.load_submap())); };
  for (int i = 0; i < recordings(); ++i) input.paths.push_back(trajectory(i));
  return export_surface(input, file, options, progress);
}

SurfaceChanges Mapper::surface_changes(int max_bricks, bool all) {
  State& s = *state_;
  const Atlas& atlas = s.back_end.atlas();
  const int submap = static_cast<int>(s.back_end.submaps().size());
  SurfaceChanges changes;
  const auto take = [&] {
    if (!s.surface) {
      s.surface.emplace();
      s.surface->change(s.volume.bricks());
    }
    changes.parts = s.surface->take(s.volume, s.polygonizer, submap, max_bricks, all);
  };
  s.shows_surface = s.shows_surface && s.warnings().attempt("the surface is no longer shown", take);
  changes.world_from_submap.assign(static_cast<std::size_t>(submap) + 1, Eigen::Isometry3d::Identity());
  for (std::size_t k = atlas.keyframes.size(); k-- > 0;)  // a submap lies as its first keyframe
    changes.world_from_submap[atlas.keyframes[k].submap] = atlas.correction(k);
  return changes;
}

std::shared_ptr<const DistanceField> Mapper::distances() {
  State& s = *state_;
  return distances_of(s.device, s.world().on_host(), s.options.fuse, s.options.esdf);
}

std::shared_ptr<const DistanceField> Mapper::live_distances() const { return state_->live_distances.get(); }

void Mapper::write_map(const std::filesystem::path& file) {
  std::shared_ptr<const DistanceField> field;
  if (state_->options.esdf.live)
    state_->warnings().attempt(file.string() + " has no grid `esdf`", [&] { field = distances(); });
  write_grids(file, state_->world().on_host(),
              {.voxel_size = state_->options.fuse.voxel_size, .truncation = state_->options.fuse.truncation},
              field.get());
}

Mapper::Statistics Mapper::statistics() const {
  const auto& counts = state_->volume.counts();
  Statistics statistics{.device = state_->device.info().name,
                        .device_memory_peak = state_->device.peak_memory(),
                        .bricks = counts.allocated,
                        .paged_out = counts.paged_out,
                        .paged_in = counts.paged_in,
                        .clock_offset = state_->tracker.clock_offset(),
                        .focal = state_->tracker.focal(),
                        .tilt = {},
                        .kernels = {}};
  const BackEnd& back_end = state_->back_end;
  statistics.keyframes = static_cast<int>(back_end.atlas().keyframes.size());
  statistics.submaps = static_cast<int>(back_end.submaps().size());
  const auto component_of = back_end.atlas().components();
  statistics.components = static_cast<int>(std::set(component_of.begin(), component_of.end()).size());
  statistics.looked_up = back_end.counts().looked_up, statistics.loops_tried = back_end.counts().tried;
  statistics.graph_ms = back_end.counts().graph_ms, statistics.world_ms = back_end.counts().world_ms;
  statistics.submap_memory_peak = back_end.submaps().counts().peak_bytes;
  statistics.submaps_read_back = back_end.submaps().counts().read_back;
  if (const Eigen::Vector3d& up = state_->acceleration; up.norm() > 0)
    statistics.tilt = std::acos(std::clamp(-up.normalized().y(), -1.0, 1.0));
  for (const auto& [name, time] : state_->device.kernel_times()) statistics.kernels[name] = {time.calls, time.total_ms};
  return statistics;
}

}  // namespace cairn
