// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "map/session.hpp"

#include <fmt/format.h>

#include <boost/crc.hpp>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <type_traits>

#include "io/atomic_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kVersion = 2;
constexpr const char* kMagic = "cairn session";

std::uint32_t checksum(const std::vector<std::uint8_t>& bytes) {
  boost::crc_32_type crc;
  crc.process_bytes(bytes.data(), bytes.size());
  return crc.checksum();
}

/// Numbers as they are in memory.
template <class T>
Json blob(const std::vector<T>& values) {
  static_assert(std::is_arithmetic_v<T>);
  std::vector<std::uint8_t> bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return Json::binary(std::move(bytes));
}
template <class T>
std::vector<T> unblob(const Json& json) {
  const auto& bytes = json.get_binary();
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

/// One after the other: writing and reading in the same order.
class Out {
 public:
  template <class Derived>
  Out& operator<<(const Eigen::MatrixBase<Derived>& m) {
    const typename Derived::PlainObject plain = m;
    numbers_.insert(numbers_.end(), plain.data(), plain.data() + plain.size());
    return *this;
  }
  Out& operator<<(const Eigen::Isometry3d& t) { return *this << t.matrix(); }
  template <class T>
  requires std::is_arithmetic_v<T> Out& operator<<(T value) {
    numbers_.push_back(static_cast<double>(value));
    return *this;
  }
  [[nodiscard]] Json json() const { return blob(numbers_); }

 private:
  std::vector<double> numbers_;  // integers up to 2^53 are exact
};

class In {
 public:
  explicit In(const Json& json) : numbers_(unblob<double>(json)) {}
  [[nodiscard]] bool at_end() const { return at_ >= numbers_.size(); }
  double next() {
    if (at_end()) throw std::runtime_error("it ends early");
    return numbers_[at_++];
  }
  template <class Derived>
  In& operator>>(Eigen::MatrixBase<Derived>& m) {
    for (Eigen::Index i = 0; i < m.size(); ++i) m.derived().data()[i] = next();
    return *this;
  }
  In& operator>>(Eigen::Isometry3d& t) { return *this >> t.matrix(); }
  In& operator>>(bool& value) {
    value = next() != 0;
    return *this;
  }
  template <class T>
  requires std::is_arithmetic_v<T> In& operator>>(T& value) {
    value = static_cast<T>(next());
    return *this;
  }

 private:
  std::vector<double> numbers_;
  std::size_t at_ = 0;
};

Json bricks_json(const std::vector<Brick>& bricks) {
  std::vector<std::int32_t> numbers;
  for (const Brick& b : bricks) numbers.insert(numbers.end(), b.data(), b.data() + 3);
  return blob(numbers);
}
std::vector<Brick> bricks_of(const Json& json) {
  const auto numbers = unblob<std::int32_t>(json);
  std::vector<Brick> bricks;
  for (std::size_t i = 0; i + 2 < numbers.size(); i += 3)
    bricks.emplace_back(numbers[i], numbers[i + 1], numbers[i + 2]);
  return bricks;
}

Json atlas_json(const Atlas& atlas) {
  Out keyframes, loops, frames, recordings;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    const Keyframe& f = atlas.keyframes[k];
    keyframes << f.frame << f.timestamp << f.colour_delay << f.submap << f.searched << f.follows << f.piece_from_camera
              << f.submap_from_camera << f.information << f.acceleration.has_value()
              << f.acceleration.value_or(Eigen::Vector3d::Zero()) << atlas.world_from_camera[k];
  }
  for (const Loop& l : atlas.loops)
    loops << l.edge.from << l.edge.to << l.edge.from_from_to << l.edge.information << l.corners << l.inlier_share
          << l.rmse << l.believed;
  for (const FusedFrame& f : atlas.frames) frames << f.timestamp << f.submap_from_camera << f.keyframe;
  for (const std::size_t first : atlas.recordings) recordings << first;
  return {{"keyframes", keyframes.json()},
          {"loops", loops.json()},
          {"frames", frames.json()},
          {"recordings", recordings.json()}};
}

Atlas atlas_of(const Json& json) {
  Atlas atlas;
  for (In in(json.at("keyframes")); !in.at_end();) {
    Keyframe f;
    bool has_acceleration = false;
    Eigen::Vector3d acceleration;
    Eigen::Isometry3d world_from_camera;
    in >> f.frame >> f.timestamp >> f.colour_delay >> f.submap >> f.searched >> f.follows >> f.piece_from_camera >>
        f.submap_from_camera >> f.information >> has_acceleration >> acceleration >> world_from_camera;
    if (has_acceleration) f.acceleration = acceleration;
    atlas.keyframes.push_back(f);
    atlas.world_from_camera.push_back(world_from_camera);
  }
  const auto known = [&](std::size_t keyframe) {
    if (keyframe >= atlas.keyframes.size()) throw std::runtime_error("a keyframe is missing");
  };
  for (In in(json.at("loops")); !in.at_end();) {
    Loop l;
    in >> l.edge.from >> l.edge.to >> l.edge.from_from_to >> l.edge.information >> l.corners >> l.inlier_share >>
        l.rmse >> l.believed;
    l.edge.may_be_false = true;
    known(l.edge.from), known(l.edge.to);
    atlas.loops.push_back(l);
  }
  for (In in(json.at("frames")); !in.at_end();) {
    FusedFrame f;
    in >> f.timestamp >> f.submap_from_camera >> f.keyframe;
    known(f.keyframe);
    atlas.frames.push_back(f);
  }
  for (In in(json.at("recordings")); !in.at_end();) in >> atlas.recordings.emplace_back();
  return atlas;
}

Json back_end_json(const BackEnd::Memory& m) {
  Out places, numbers, submaps;
  for (const auto& pose : m.places) places << pose;
  for (const bool has_file : m.submaps) submaps << has_file;
  numbers << m.searched << m.submap_begin << m.submap_since << m.in_world << m.breaks << m.unsettled << m.optimising;
  return {{"atlas", atlas_json(m.atlas)},
          {"places", places.json()},
          {"submaps", submaps.json()},
          {"numbers", numbers.json()}};
}
BackEnd::Memory back_end_of(const Json& json) {
  BackEnd::Memory m;
  m.atlas = atlas_of(json.at("atlas"));
  for (In in(json.at("places")); !in.at_end();) in >> m.places.emplace_back();
  for (In in(json.at("submaps")); !in.at_end();) m.submaps.push_back(in.next() != 0);
  In numbers(json.at("numbers"));
  numbers >> m.searched >> m.submap_begin >> m.submap_since >> m.in_world >> m.breaks >> m.unsettled >> m.optimising;
  if (m.places.size() != m.atlas.keyframes.size()) throw std::runtime_error("places and keyframes do not match");
  return m;
}

Json tracker_json(const Tracker::Memory& m, const PhotometricKeyframe::Saved& k) {
  Out last, numbers, keyframe;
  for (const auto& moment : m.last) last << moment.timestamp << moment.submap_from_camera;
  numbers << m.usual_brightness << m.lost << m.first_place << m.clock_offset_frames << m.focal_pairs;
  for (const double cost : m.clock_offset_costs) numbers << cost;
  for (const double cost : m.focal_costs) numbers << cost;
  keyframe << k.submap_from_camera << k.moment.velocity << k.moment.stamp_delay << k.moment.clock_offset;
  Json levels = Json::array();
  for (const auto& level : k.levels) levels.push_back(blob(level));
  return {{"last", last.json()}, {"numbers", numbers.json()}, {"keyframe", keyframe.json()}, {"levels", levels}};
}
void tracker_of(const Json& json, Tracker::Memory& m, PhotometricKeyframe::Saved& k) {
  for (In in(json.at("last")); !in.at_end();) {
    auto& moment = m.last.emplace_back();
    in >> moment.timestamp >> moment.submap_from_camera;
  }
  In numbers(json.at("numbers")), keyframe(json.at("keyframe"));
  numbers >> m.usual_brightness >> m.lost >> m.first_place >> m.clock_offset_frames >> m.focal_pairs;
  for (double& cost : m.clock_offset_costs) numbers >> cost;
  for (double& cost : m.focal_costs) numbers >> cost;
  keyframe >> k.submap_from_camera >> k.moment.velocity >> k.moment.stamp_delay >> k.moment.clock_offset;
  for (const Json& level : json.at("levels")) k.levels.push_back(unblob<std::uint32_t>(level));
}

Json residency_json(const Volume::Residency& r) {
  Out origin;
  origin << r.origin << r.counts.allocated << r.counts.paged_out << r.counts.paged_in;
  return {{"origin", origin.json()},
          {"on_device", bricks_json(r.on_device)},
          {"on_host", bricks_json(r.on_host)},
          {"device_last_seen", blob(r.device_last_seen)},
          {"host_last_seen", blob(r.host_last_seen)}};
}
Volume::Residency residency_of(const Json& json) {
  Volume::Residency r{.on_device = bricks_of(json.at("on_device")),
                      .on_host = bricks_of(json.at("on_host")),
                      .device_last_seen = unblob<std::uint32_t>(json.at("device_last_seen")),
                      .host_last_seen = unblob<std::uint32_t>(json.at("host_last_seen"))};
  In origin(json.at("origin"));
  origin >> r.origin.x() >> r.origin.y() >> r.origin.z() >> r.counts.allocated >> r.counts.paged_out >>
      r.counts.paged_in;
  if (r.device_last_seen.size() != r.on_device.size() || r.host_last_seen.size() != r.on_host.size())
    throw std::runtime_error("bricks and their stamps do not match");
  return r;
}

Json camera_json(const Camera& c) {
  return {{"width", c.width}, {"height", c.height},        {"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx},
          {"cy", c.cy},       {"distortion", c.distortion}};
}
Camera camera_of(const Json& j) {
  return {j.at("width"), j.at("height"), j.at("fx"), j.at("fy"), j.at("cx"), j.at("cy"), j.at("distortion")};
}

fs::path active_file(const fs::path& folder, std::uint64_t number) {
  return folder / fmt::format("active-{:06}.vdb", number);
}

}  // namespace

void write_session(const fs::path& folder, const Session& s, const BrickTree& active) {
  fs::create_directories(folder);
  write_bricks(active_file(folder, s.number), active);
  Out numbers;
  numbers << s.stamp << s.repeats << s.lost << s.last_fused.has_value() << s.last_fused.value_or(0) << s.acceleration;
  const Json state{{"camera", camera_json(s.camera)},
                   {"voxel_size", s.fuse.voxel_size},
                   {"truncation", s.fuse.truncation},
                   {"min_depth", s.min_depth},
                   {"max_depth", s.max_depth},
                   {"back_end", back_end_json(s.back_end)},
                   {"tracker", tracker_json(s.tracker, s.keyframe)},
                   {"residency", residency_json(s.residency)},
                   {"numbers", numbers.json()},
                   {"last_image", s.last_image},
                   {"number", s.number},
                   {"note", s.note}};
  const auto bytes = Json::to_cbor(state);
  write_whole(folder / "state.cbor", [&](const fs::path& temporary) {
    std::ofstream out(temporary, std::ios::binary);
    out << fmt::format("{} {} {:08x}\n", kMagic, kVersion, checksum(bytes));
    out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
    if (!out.flush()) throw std::runtime_error("the disk is full");
  });
  // From here on the new state counts.
  std::vector<fs::path> stale;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("active-") && entry.path() != active_file(folder, s.number)) stale.push_back(entry.path());
  }
  std::error_code ignored;
  for (const auto& file : stale) fs::remove(file, ignored);
}

ReadSession read_session(const fs::path& folder) {
  const fs::path file = folder / "state.cbor";
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": there is no session to go on with; run without --resume first");
  std::string magic(std::strlen(kMagic), ' ');
  int version = 0;
  std::uint32_t sum = 0;
  in.read(magic.data(), static_cast<std::streamsize>(magic.size()));
  in >> version >> std::hex >> sum;
  in.get();
  constexpr const char* kAgain = "reconstruct again without --resume";
  if (!in || magic != kMagic) throw std::runtime_error(file.string() + ": is no session of cairn; " + kAgain);
  if (version != kVersion)
    throw std::runtime_error(
        fmt::format("{}: was written by another version of cairn (format {}, this one reads {}); {}", file.string(),
                    version, kVersion, kAgain));
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(in), {}};
  if (checksum(bytes) != sum) throw std::runtime_error(file.string() + ": is damaged; " + kAgain);
  ReadSession read;
  Session& s = read.session;
  try {
    const Json state = Json::from_cbor(bytes);
    s.camera = camera_of(state.at("camera"));
    s.fuse.voxel_size = state.at("voxel_size");
    s.fuse.truncation = state.at("truncation");
    s.min_depth = state.at("min_depth");
    s.max_depth = state.at("max_depth");
    s.back_end = back_end_of(state.at("back_end"));
    tracker_of(state.at("tracker"), s.tracker, s.keyframe);
    s.residency = residency_of(state.at("residency"));
    In numbers(state.at("numbers"));
    bool was_fused = false;
    double last_fused = 0;
    numbers >> s.stamp >> s.repeats >> s.lost >> was_fused >> last_fused >> s.acceleration;
    if (was_fused) s.last_fused = last_fused;
    s.last_image = state.at("last_image");
    s.number = state.at("number");
    s.note = state.at("note");
  } catch (const std::exception& error) {
    throw std::runtime_error(file.string() + ": is damaged (" + error.what() + "); " + kAgain);
  }
  try {
    read.active = read_bricks(active_file(folder, s.number));
  } catch (const std::exception& error) {
    throw std::runtime_error(std::string(error.what()) + "; the session is damaged: " + kAgain);
  }
  return read;
}

}  // namespace cairn
