// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/state.hpp"

#include <fmt/format.h>

#include <array>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <stdexcept>
#include <type_traits>
#include <utility>

#include "base/json_text.hpp"

namespace cairn {
namespace {

using Json = nlohmann::json;

template <class T>
concept Number = std::is_arithmetic_v<T> || std::is_enum_v<T>;
template <class T, class Struct>
concept Of = std::same_as<std::remove_const_t<T>, Struct>;

/// Value present only in formats up to `last`.
template <int last, class T>
struct Until {};

// Fields of each struct, listed once: Out writes and In reads the arguments of `io`. Fields added after the oldest
// readable format are in io.since(FORMAT, ...), removed fields are Until<FORMAT, TYPE>.

void fields(auto& io, Of<Eigen::Isometry3d> auto& pose) { io(pose.matrix()); }

void fields(auto& io, Of<Camera> auto& c) {
  io(c.width, c.height, c.fx, c.fy, c.cx, c.cy, c.distortion, c.lens, c.readout);
}

void fields(auto& io, Of<ColorCamera> auto& c) { io(c.camera, c.color_from_depth); }

void fields(auto& io, Of<SensorModel> auto& m) {
  io(m.floor, m.growth, m.sharpest, m.min_depth, m.max_depth, m.weight, m.min_confidence);
  io.since(16, m.common_error);
}

void fields(auto& io, Of<Eigen::Quaterniond> auto& q) { io(q.coeffs()); }

void fields(auto& io, Of<DepthCorrection> auto& c) { io(c.columns, c.rows, c.offsets); }

void fields(auto& io, Of<Rig> auto& r) {
  io(r.depth, r.color, r.sensor, r.camera_from_imu);
  io.since(11, r.depth_correction);
}

void fields(auto& io, Of<Structure::Facing> auto& f) { io(f.normal, f.area); }

void fields(auto& io, Of<Structure> auto& s) { io(s.facings, s.area); }

void fields(auto& io, Of<Preintegration> auto& m) {
  io(m.bias.gyro, m.bias.acceleration, m.seconds, m.rotation, m.velocity, m.position, m.covariance, m.rotation_by_gyro,
     m.velocity_by_gyro, m.velocity_by_acceleration, m.position_by_gyro, m.position_by_acceleration);
}

void fields(auto& io, Of<MeasuredGravity> auto& g) { io(g.down, g.sigma); }

void fields(auto& io, Of<InertialMount> auto& m) { io(m.imu_from_camera, m.lever); }

void fields(auto& io, Of<Keyframe> auto& k) {
  io(k.frame, k.timestamp, k.color_delay, k.submap, k.searched, k.follows, k.odometry_from_camera, k.submap_from_camera,
     k.information, k.acceleration);
  io.since(10, k.accelerations, k.structure);
  io.since(16, k.device_pose, k.device_drift);
  io.since(18, k.inertial.step, k.inertial.gravity);
}

void fields(auto& io, Of<FrozenGravity> auto& s) { io(s.keyframe, s.found.down, s.found.source, s.found.description); }

void fields(auto& io, Of<Loop> auto& l) {
  io(l.edge.i, l.edge.j, l.edge.i_from_j, l.edge.information, l.edge.is_loop_closure, l.feature_inliers, l.inlier_share,
     l.rmse, l.inlier);
}

void fields(auto& io, Of<AdjustedStep> auto& s) { io(s.before_from_camera, s.information); }

void fields(auto& io, Of<FusedFrame> auto& f) { io(f.timestamp, f.keyframe, f.twist); }

void fields(auto& io, Of<Tracker::Moment> auto& m) { io(m.timestamp, m.submap_from_camera); }

void fields(auto& io, Of<DeviceDrift> auto& d) { io(d.rotation, d.translation); }

void fields(auto& io, Of<DeviceWindow> auto& w) { io(w.timestamp, w.device, w.tracked); }

void fields(auto& io, Of<Tracker::State> auto& m) {
  io(m.last, m.last_aligned, m.last_is_degenerate, m.typical.photometric_rmse, m.lost_frames, m.lost_views,
     m.clock_offset_costs, m.clock_offset_frames, m.focal_costs, m.focal_pairs, m.last_guess, m.guess_error,
     m.motion_error, m.guesses, m.frames_of_prediction);
  io.since(16, m.typical.misfit, m.device.window, m.device.windows, m.device.contradictions);
}

void fields(auto& io, Of<PhotometricKeyframe::SavedState> auto& k) {
  io(k.submap_from_camera, k.moment.velocity, k.moment.stamp_delay, k.moment.clock_offset, k.levels);
}

void fields(auto& io, Of<AngularRate> auto& r) { io(r.timestamp, r.rate); }

void fields(auto& io, Of<Gyroscope::State> auto& m) {
  io(m.samples, m.count, m.imu, m.camera, m.camera_imu);
  io.since(18, m.recent, m.squared_errors, m.squares);
}

void fields(auto& io, Of<Acceleration> auto& a) { io(a.timestamp, a.value); }

void fields(auto& io, Of<InertialOdometry::Filter> auto& f) {
  io(f.timestamp, f.rotation, f.position, f.velocity, f.bias.gyro, f.bias.acceleration, f.gravity, f.imu_from_camera,
     f.lever, f.clock, f.covariance);
}

void fields(auto& io, Of<InertialOdometry::TrackedPose> auto& p) { io(p.timestamp, p.world_from_camera, p.covariance); }

void fields(auto& io, Of<InertialOdometry::State> auto& s) {
  io(s.rates, s.accelerations, s.window, s.filter, s.prior, s.poses_since_start, s.test, s.test_poses,
     s.passed_rotation, s.passed_position, s.is_tested, s.noise_scale, s.failed_starts, s.rejected, s.is_contradicted,
     s.is_gyro_contradicted);
  io.since(18, s.keyframe);
}

void fields(auto& io, Of<Raycaster::SavedState> auto& p) { io(p.submap_from_camera, p.points); }

void fields(auto& io, Of<Volume::SavedState> auto& r) {
  io(r.origin, r.on_device, r.on_host, r.device_last_seen, r.host_last_seen, r.counts.allocated, r.counts.paged_out,
     r.counts.paged_in);
}

void fields(auto& io, Of<SurfaceSigma::Cell> auto& c) { io(c.at, c.variance, c.weight); }

void fields(auto& io, const SurfaceSigma& sigma) { io(sigma.cells()); }

void fields(auto& io, SurfaceSigma& sigma) {
  std::vector<SurfaceSigma::Cell> cells;
  io(cells);
  sigma = SurfaceSigma(cells);
}

void fields(auto& io, Of<GraphSnapshot> auto& b) { io(b.keyframes, b.loops, b.world_from_camera); }

void fields(auto& io, const SourceMapFiles& p) {
  io(p.folder.string(), p.first_keyframe, p.keyframes, p.first_submap, p.submaps);
}

void fields(auto& io, SourceMapFiles& p) {
  std::string folder;
  io(folder, p.first_keyframe, p.keyframes, p.first_submap, p.submaps);
  p.folder = folder;
}

/// Newest keyframes, loops and frames, not yet in chunk files.
struct Newest {
  std::vector<Keyframe> keyframes;
  std::vector<Loop> loops;
  FusedFrames::Chunk frames;
};

/// Entries of state.cbor by name.
void entries(auto& io, Of<SessionState> auto& s, Of<Newest> auto& newest, Of<NamedFiles> auto& files) {
  io("rig", s.rig);
  io("options", s.fuse.voxel_size, s.fuse.truncation, s.min_depth, s.max_depth);
  auto& m = s.back_end;
  io("keyframes", newest.keyframes);
  io.since(14, "keyframe_files", files.keyframe_files);
  io("world_from_camera", m.atlas.world_from_camera);
  io("loops", newest.loops);
  io.since(14, "loop_files", files.loop_files);
  io("frames", newest.frames);
  io("frame_files", files.frame_files);
  io("recordings", m.atlas.recordings);
  io.since(10, "upright", m.atlas.up, m.atlas.frozen_gravity);
  io.since(12, "surface_sigma", m.atlas.surface_sigma);
  io.since(15, "adjusted_steps", m.atlas.steps);
  io.since(18, "inertial_graph", m.atlas.inertial_mount, m.inertial_keyframes);
  io("submaps", m.submaps);
  io("tracked_from_camera", m.tracked_from_camera);
  io("back_end", m.searched, m.submap_begin, m.submap_since, m.tracks_in_world, m.starts_component,
     m.scheduler.has_pending_loops, m.searching, m.scheduler.closing);
  io.since(14, "whole_graph", m.scheduler.full, m.scheduler.next_full);
  io("tracker", s.tracker.state);
  io("photometric_keyframe", s.tracker.reference);
  io("prediction", s.tracker.prediction);
  io("gyroscope", s.tracker.gyroscope);
  io.since(17, "inertial", s.tracker.inertial);
  io("residency", s.residency);
  io("mapper", s.fused_count, s.last_depth_hash, s.repeated_images, s.last_fused, Until<9, Eigen::Vector3d>{});
  io("number", s.number);
  io("run", files.run);
  io.since(13, "parts", files.source_maps);
  io("note", s.note);
}

/// Writes values one after the other as they are in memory; the count of a list precedes its values.
class Out {
 public:
  void operator()(const auto&... values) { (put(values), ...); }
  void since(int, const auto&... values) { (*this)(values...); }
  [[nodiscard]] std::vector<std::uint8_t> take() { return std::move(bytes_); }

 private:
  template <Number T>
  void append(const T* values, std::size_t count) {
    const auto* bytes = reinterpret_cast<const std::uint8_t*>(values);
    bytes_.insert(bytes_.end(), bytes, bytes + count * sizeof(T));
  }
  template <class T>
  void put(const T& value) {
    fields(*this, value);
  }
  template <int last, class T>
  void put(const Until<last, T>&) {}
  template <Number T>
  void put(const T& value) {
    append(&value, 1);
  }
  template <class T, int rows, int columns>
  void put(const Eigen::Matrix<T, rows, columns>& m) {
    append(m.data(), static_cast<std::size_t>(m.size()));
  }
  template <class T, std::size_t count>
  void put(const std::array<T, count>& values) {
    append(values.data(), count);
  }
  template <class T>
  void put(const std::optional<T>& value) {
    put(value.has_value());
    if (value) put(*value);
  }
  void put(const std::string& text) {
    put(std::uint64_t{text.size()});
    append(text.data(), text.size());
  }
  template <class T>
  void put(const std::vector<T>& values) {
    put(std::span(values));
  }
  void put(const std::vector<bool>& values) {
    put(std::uint64_t{values.size()});
    for (const bool value : values) put(value);
  }
  template <class T>
  void put(std::span<const T> values) {
    put(std::uint64_t{values.size()});
    if constexpr (Number<T>)
      append(values.data(), values.size());
    else
      for (const T& value : values) put(value);
  }

  std::vector<std::uint8_t> bytes_;
};

/// Reads the output of Out. Allocates only as much memory as there are bytes, whatever a count says.
class In {
 public:
  In(std::span<const std::uint8_t> bytes, int format) : bytes_(bytes), format_(format) {}
  void operator()(auto&&... values) { (get(values), ...); }
  void since(int format, auto&... values) {
    if (format_ >= format) (*this)(values...);
  }
  [[nodiscard]] bool at_end() const { return bytes_.empty(); }

 private:
  template <Number T>
  void take(T* values, std::size_t count) {
    if (bytes_.size() / sizeof(T) < count) throw std::runtime_error("ends early");
    if (count > 0) std::memcpy(values, bytes_.data(), count * sizeof(T));
    bytes_ = bytes_.subspan(count * sizeof(T));
  }
  template <Number T>
  T next() {
    T value{};
    get(value);
    return value;
  }
  template <class T>
  void get(T& value) {
    fields(*this, value);
  }
  template <int last, class T>
  void get(Until<last, T>&) {
    T gone;
    if (format_ <= last) get(gone);
  }
  template <Number T>
  void get(T& value) {
    take(&value, 1);
  }
  void get(bool& value) { value = next<std::uint8_t>() != 0; }
  template <class T, int rows, int columns>
  void get(Eigen::Matrix<T, rows, columns>& m) {
    take(m.data(), static_cast<std::size_t>(m.size()));
  }
  template <class T, std::size_t count>
  void get(std::array<T, count>& values) {
    take(values.data(), count);
  }
  template <class T>
  void get(std::optional<T>& value) {
    if (next<bool>()) get(value.emplace());
  }
  template <class List>
  void get_numbers(List& list) {
    const auto count = next<std::uint64_t>();
    if (count > bytes_.size() / sizeof(list[0])) throw std::runtime_error("ends early");
    list.resize(count);
    take(list.data(), list.size());
  }
  void get(std::string& text) { get_numbers(text); }
  void get(std::vector<bool>& values) {
    for (auto count = next<std::uint64_t>(); count > 0; --count) values.push_back(next<bool>());
  }
  template <class T>
  void get(std::vector<T>& values) {
    if constexpr (Number<T>)
      get_numbers(values);
    else
      for (auto count = next<std::uint64_t>(); count > 0; --count) get(values.emplace_back());
  }

  std::span<const std::uint8_t> bytes_;
  int format_;
};

class WriteEntries {
 public:
  explicit WriteEntries(Json& json) : json_(json) {}
  void operator()(const char* name, const auto&... values) {
    Out out;
    out(values...);
    json_[name] = Json::binary(out.take());
  }
  void since(int, const char* name, const auto&... values) { (*this)(name, values...); }

 private:
  Json& json_;
};

class ReadEntries {
 public:
  ReadEntries(const Json& json, int format) : json_(json), format_(format) {}
  void operator()(const char* name, auto&&... values) {
    const Json& entry = json_.at(name);
    try {
      In in(entry.get_binary(), format_);
      in(values...);
      if (!in.at_end()) throw std::runtime_error("is too long");
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("'{}' {}", name, plain(error.what())));
    }
  }
  void since(int format, const char* name, auto&... values) {
    if (format_ >= format) (*this)(name, values...);
  }

 private:
  const Json& json_;
  int format_;
};

Json json_of(const char* name, const auto& list) {
  Json json = Json::object();
  WriteEntries io(json);
  io(name, list);
  return json;
}

template <class T>
std::vector<T> list_of(const char* name, const Json& json, int format) {
  std::vector<T> list;
  ReadEntries io(json, format);
  io(name, list);
  return list;
}

}  // namespace

Json json_of(const SessionState& session, const NamedFiles& files) {
  const Atlas& atlas = session.back_end.atlas;
  const auto rest = [](const auto& all, const std::vector<std::string>& chunks) {
    return std::vector(all.begin() + static_cast<std::ptrdiff_t>(NamedFiles::kChunk * chunks.size()), all.end());
  };
  const Newest newest{.keyframes = rest(atlas.keyframes, files.keyframe_files),
                      .loops = rest(atlas.loops, files.loop_files),
                      .frames = atlas.frames.rest()};
  Json json = Json::object();
  WriteEntries io(json);
  entries(io, session, newest, files);
  return json;
}

StateFile state_of(const Json& json, int format) {
  StateFile state;
  Newest newest;
  ReadEntries io(json, format);
  entries(io, state.session, newest, state.files);
  if (format < 10)  // only the frame's own measurement is known
    for (Keyframe& k : newest.keyframes)
      if (k.acceleration) k.accelerations << *k.acceleration, k.acceleration->norm();
  Atlas& atlas = state.session.back_end.atlas;
  atlas.keyframes = std::move(newest.keyframes), atlas.loops = std::move(newest.loops);
  for (const FusedFrame& frame : newest.frames) atlas.frames.push_back(frame);
  return state;
}

Json json_of(const FusedFrames::Chunk& frames) { return json_of("frames", frames); }
Json json_of(std::span<const Keyframe> keyframes) { return json_of("keyframes", keyframes); }
Json json_of(std::span<const Loop> loops) { return json_of("loops", loops); }

FusedFrames::Chunk frames_of(const Json& json, int format) { return list_of<FusedFrame>("frames", json, format); }
std::vector<Keyframe> keyframes_of(const Json& json, int format) {
  return list_of<Keyframe>("keyframes", json, format);
}
std::vector<Loop> loops_of(const Json& json, int format) { return list_of<Loop>("loops", json, format); }

}  // namespace cairn
