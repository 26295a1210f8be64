// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "session/session.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <boost/crc.hpp>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <string_view>
#include <type_traits>

#include "base/atomic_file.hpp"
#include "base/json_text.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kVersion = 4;
constexpr const char* kMagic = "cairn session";
constexpr const char* kFrames = "cairn frames";
constexpr const char* kState = "state.cbor";
constexpr const char* kKeyframes = "keyframes";
constexpr const char* kAgain = "reconstruct again without --resume";

std::uint32_t checksum(std::string_view bytes) {
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
  if (bytes.size() % sizeof(T) != 0) throw std::runtime_error("a number is cut off");
  std::vector<T> values(bytes.size() / sizeof(T));
  if (!values.empty()) std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

void require(bool is_so, const char* otherwise) {
  if (!is_so) throw std::runtime_error(otherwise);
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
    const double number = next();
    if constexpr (std::is_integral_v<T>) {
      const double end = std::ldexp(1.0, std::numeric_limits<T>::digits);  // one past the last
      if (!(number >= static_cast<double>(std::numeric_limits<T>::min()) && number < end &&
            number == std::floor(number)))
        throw std::runtime_error("a number is out of range");
    }
    value = static_cast<T>(number);
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

Json frames_json(const FusedFrames::Chunk& frames) {
  std::vector<double> stamps;
  std::vector<std::uint32_t> keyframes;
  std::vector<float> twists;
  for (const FusedFrame& f : frames) {
    stamps.push_back(f.timestamp), keyframes.push_back(f.keyframe);
    twists.insert(twists.end(), f.twist.begin(), f.twist.end());
  }
  return {{"stamps", blob(stamps)}, {"keyframes", blob(keyframes)}, {"twists", blob(twists)}};
}
/// Of a session with so many keyframes.
FusedFrames::Chunk frames_of(const Json& json, std::size_t keyframe_count) {
  const auto stamps = unblob<double>(json.at("stamps"));
  const auto keyframes = unblob<std::uint32_t>(json.at("keyframes"));
  const auto twists = unblob<float>(json.at("twists"));
  require(keyframes.size() == stamps.size() && twists.size() == 6 * stamps.size(),
          "frames and their places do not match");
  FusedFrames::Chunk frames;
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    const FusedFrame& f = frames.emplace_back(
        FusedFrame{stamps[i], keyframes[i], Eigen::Map<const Eigen::Matrix<float, 6, 1>>(&twists[6 * i])});
    require(f.keyframe < keyframe_count, "a keyframe is missing");
    require(std::isfinite(f.timestamp) && f.twist.allFinite(), "a number is none");
  }
  return frames;
}

/// Without the full chunks of frames, which have files of their own.
Json atlas_json(const Atlas& atlas) {
  Out keyframes, loops, recordings;
  for (std::size_t k = 0; k < atlas.keyframes.size(); ++k) {
    const Keyframe& f = atlas.keyframes[k];
    keyframes << f.frame << f.timestamp << f.colour_delay << f.submap << f.searched << f.follows
              << f.odometry_from_camera << f.submap_from_camera << f.information << f.acceleration.has_value()
              << f.acceleration.value_or(Eigen::Vector3d::Zero()) << atlas.world_from_camera[k];
  }
  for (const Loop& l : atlas.loops)
    loops << l.edge.i << l.edge.j << l.edge.i_from_j << l.edge.information << l.corners << l.inlier_share << l.rmse
          << l.inlier;
  for (const std::size_t first : atlas.recordings) recordings << first;
  return {{"keyframes", keyframes.json()},
          {"loops", loops.json()},
          {"frames", frames_json(atlas.frames.rest())},
          {"recordings", recordings.json()}};
}

Atlas atlas_of(const Json& json) {
  Atlas atlas;
  for (In in(json.at("keyframes")); !in.at_end();) {
    Keyframe f;
    bool has_acceleration = false;
    Eigen::Vector3d acceleration;
    Eigen::Isometry3d world_from_camera;
    in >> f.frame >> f.timestamp >> f.colour_delay >> f.submap >> f.searched >> f.follows >> f.odometry_from_camera >>
        f.submap_from_camera >> f.information >> has_acceleration >> acceleration >> world_from_camera;
    if (has_acceleration) f.acceleration = acceleration;
    atlas.keyframes.push_back(f);
    atlas.world_from_camera.push_back(world_from_camera);
  }
  for (In in(json.at("loops")); !in.at_end();) {
    Loop l;
    in >> l.edge.i >> l.edge.j >> l.edge.i_from_j >> l.edge.information >> l.corners >> l.inlier_share >> l.rmse >>
        l.inlier;
    l.edge.is_loop_closure = true;
    atlas.loops.push_back(l);
  }
  for (const FusedFrame& f : frames_of(json.at("frames"), atlas.keyframes.size())) atlas.frames.push_back(f);
  for (In in(json.at("recordings")); !in.at_end();) in >> atlas.recordings.emplace_back();
  return atlas;
}

Json back_end_json(const BackEnd::Memory& m) {
  Out places, numbers, submaps;
  for (const auto& [pose, is_here] : m.places) places << pose << is_here;
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
  for (In in(json.at("places")); !in.at_end();) {
    auto& [pose, is_here] = m.places.emplace_back();
    in >> pose >> is_here;
  }
  for (In in(json.at("submaps")); !in.at_end();) m.submaps.push_back(in.next() != 0);
  In numbers(json.at("numbers"));
  numbers >> m.searched >> m.submap_begin >> m.submap_since >> m.in_world >> m.breaks >> m.unsettled >> m.optimising;
  return m;
}

Json tracker_json(const Tracker::Memory& m, const PhotometricKeyframe::Saved& k) {
  Out last, numbers, keyframe;
  for (const auto& moment : m.last) last << moment.timestamp << moment.submap_from_camera;
  numbers << m.usual_brightness << m.lost << m.clock_offset_frames << m.focal_pairs;
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
  numbers >> m.usual_brightness >> m.lost >> m.clock_offset_frames >> m.focal_pairs;
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
  return r;
}

Json camera_json(const Camera& c) {
  return {{"width", c.width}, {"height", c.height},        {"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx},
          {"cy", c.cy},       {"distortion", c.distortion}};
}
Camera camera_of(const Json& j) {
  return {j.at("width"), j.at("height"), j.at("fx"), j.at("fy"), j.at("cx"), j.at("cy"), j.at("distortion")};
}

fs::path active_file(const fs::path& files, std::uint64_t number) {
  return files / fmt::format("active-{:06}.vdb", number);
}

bool is_frames(std::string_view name) {
  return name.starts_with("frames-") && name.ends_with(".cbor") && name.find('/') == std::string_view::npos;
}

/// The number of a run by the name of its folder, run-N.
std::optional<unsigned long> run_number(const std::string& name) {
  constexpr std::string_view kRun = "run-";
  unsigned long number = 0;
  const char *begin = name.data() + std::min(name.size(), kRun.size()), *end = name.data() + name.size();
  if (!name.starts_with(kRun) || begin == end) return std::nullopt;
  const auto [stop, error] = std::from_chars(begin, end, number);
  if (error != std::errc() || stop != end) return std::nullopt;
  return number;
}

void require_rigid(const Eigen::Isometry3d& pose) {
  constexpr double kBent = 0.01;  // that rounding never reaches
  const Eigen::Matrix3d r = pose.linear();
  require(pose.matrix().allFinite() && (r.transpose() * r - Eigen::Matrix3d::Identity()).norm() < kBent &&
              r.determinant() > 0 && pose.matrix().row(3) == Eigen::RowVector4d(0, 0, 0, 1),
          "a pose is none");
}
void require_near(const Brick& brick) {
  constexpr int kFar = 1 << 24;  // bricks; nothing overflows
  require((brick.array() > -kFar).all() && (brick.array() < kFar).all(), "a brick lies nowhere");
}

/// Everything that others take for granted: numbers of what exists, finite values. `frames`: how many there are with
/// those of full chunks.
void validate(const Session& s, std::size_t frames) {
  check(s.camera);
  check(options_of(s));
  require(run_number(s.run).has_value(), "it names no run");

  const BackEnd::Memory& m = s.back_end;
  const Atlas& atlas = m.atlas;
  const std::size_t keyframes = atlas.keyframes.size(), submaps = m.submaps.size();
  for (std::size_t k = 0; k < keyframes; ++k) {
    const Keyframe& f = atlas.keyframes[k];
    require(f.submap <= submaps, "a submap is missing");
    require(f.searched <= k && !(f.follows && k == 0), "a keyframe is missing");
    require(std::isfinite(f.timestamp) && std::isfinite(f.colour_delay) && f.information.allFinite() &&
                (!f.acceleration || f.acceleration->allFinite()),
            "a number is none");
    require_rigid(f.odometry_from_camera), require_rigid(f.submap_from_camera),
        require_rigid(atlas.world_from_camera[k]);
  }
  for (const Loop& l : atlas.loops) {
    require(l.edge.i < keyframes && l.edge.j < keyframes && l.edge.i != l.edge.j, "a keyframe is missing");
    require(l.edge.information.allFinite(), "a number is none");
    require_rigid(l.edge.i_from_j);
  }
  require((frames == 0) == (keyframes == 0), "keyframes and frames do not match");
  require(std::is_sorted(atlas.recordings.begin(), atlas.recordings.end()) &&
              (atlas.recordings.empty() || atlas.recordings.back() <= frames),
          "a recording is missing");
  require(m.places.size() == keyframes, "places and keyframes do not match");
  for (const auto& [pose, is_here] : m.places) require_rigid(pose);
  require(m.searched <= keyframes && m.submap_begin <= keyframes, "a keyframe is missing");

  const Tracker::Memory& t = s.tracker;
  require(t.last.size() <= 2 && t.last.empty() == (frames == 0), "the last frames are missing");
  for (const auto& moment : t.last) {
    require(std::isfinite(moment.timestamp), "a number is none");
    require_rigid(moment.submap_from_camera);
  }
  const auto is_finite = [](double d) { return std::isfinite(d); };
  require(std::isfinite(t.usual_brightness) && t.lost >= 0 && t.clock_offset_frames >= 0 && t.focal_pairs >= 0 &&
              std::all_of(t.clock_offset_costs.begin(), t.clock_offset_costs.end(), is_finite) &&
              std::all_of(t.focal_costs.begin(), t.focal_costs.end(), is_finite) && s.repeats >= 0 && s.lost >= 0 &&
              (!s.last_fused || std::isfinite(*s.last_fused)) && s.acceleration.allFinite() &&
              s.keyframe.moment.velocity.allFinite() && std::isfinite(s.keyframe.moment.stamp_delay) &&
              std::isfinite(s.keyframe.moment.clock_offset),
          "a number is none");
  require_rigid(s.keyframe.submap_from_camera);

  const Volume::Residency& r = s.residency;
  require(r.device_last_seen.size() == r.on_device.size() && r.host_last_seen.size() == r.on_host.size(),
          "bricks and their stamps do not match");
  require_near(r.origin);
  for (const auto* bricks : {&r.on_device, &r.on_host})
    for (const Brick& brick : *bricks) require_near(brick);
}

/// CBOR that is no deeper than a session's, so that no file can use up the stack.
class Shallow : public nlohmann::detail::json_sax_dom_parser<Json> {
 public:
  explicit Shallow(Json& to) : json_sax_dom_parser(to) {}
  bool start_object(std::size_t size) { return enter() && json_sax_dom_parser::start_object(size); }
  bool start_array(std::size_t size) { return enter() && json_sax_dom_parser::start_array(size); }
  bool end_object() { return --depth_, json_sax_dom_parser::end_object(); }
  bool end_array() { return --depth_, json_sax_dom_parser::end_array(); }

 private:
  bool enter() {
    require(++depth_ < 16, "it is nested too deeply");
    return true;
  }
  int depth_ = 0;
};

/// CBOR behind a first line that was checked.
struct Checked {
  std::string cbor;
  std::uint32_t checksum = 0;
};
Checked read_checked(const fs::path& file, const std::string& magic) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw std::runtime_error(file.string() + ": cannot be opened");
  std::string begin(magic.size(), ' ');
  int version = 0;
  Checked read;
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  in >> version >> std::hex >> read.checksum;
  in.get();
  if (!in || begin != magic)
    throw std::runtime_error(fmt::format("{}: does not begin with '{}'", file.string(), magic));
  if (version != kVersion)
    throw std::runtime_error(fmt::format("{}: was written by another version of cairn (format {}, this one reads {})",
                                         file.string(), version, kVersion));
  read.cbor.assign(std::istreambuf_iterator<char>(in), {});
  if (checksum(read.cbor) != read.checksum) throw std::runtime_error(file.string() + ": is damaged");
  return read;
}
Checked read_state(const fs::path& session) {
  const fs::path file = session / kState;
  if (!fs::exists(file))
    throw std::runtime_error(file.string() + ": there is no session to go on with; run without --resume first");
  try {
    return read_checked(file, kMagic);
  } catch (const std::exception& error) {
    throw std::runtime_error(fmt::format("{}; {}", error.what(), kAgain));
  }
}
Json parsed(const std::string& cbor) {
  Json json;
  Shallow sax(json);
  Json::sax_parse(cbor, &sax, Json::input_format_t::cbor);
  return json;
}

/// With a first line for read_checked(); the checksum.
std::pair<std::string, std::uint32_t> with_first_line(const Json& json, const char* magic) {
  const auto first_line = [&](std::uint32_t sum) { return fmt::format("{} {} {:08x}\n", magic, kVersion, sum); };
  std::string bytes = first_line(0);
  const std::size_t begin = bytes.size();
  Json::to_cbor(json, bytes);
  const std::uint32_t sum = checksum(std::string_view(bytes).substr(begin));
  bytes.replace(0, begin, first_line(sum));
  return {std::move(bytes), sum};
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

/// And the files of its full chunks of frames, which are still to be read.
std::pair<Session, std::vector<std::string>> session_of(const std::string& cbor) {
  Session s;
  const Json state = parsed(cbor);
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
  numbers >> s.fused_count >> s.repeats >> s.lost >> was_fused >> last_fused >> s.acceleration;
  if (was_fused) s.last_fused = last_fused;
  s.last_image = state.at("last_image");
  s.number = state.at("number");
  s.run = state.at("run");
  s.note = state.at("note");
  std::vector<std::string> frame_files = state.at("frame_files");
  for (const std::string& name : frame_files) require(is_frames(name), "frames are missing");
  validate(s, FusedFrames::kChunk * frame_files.size() + s.back_end.atlas.frames.size());
  return {std::move(s), std::move(frame_files)};
}

FusedFrames read_frames(const fs::path& files, const std::vector<std::string>& names, const Atlas& atlas) {
  FusedFrames frames;
  for (const std::string& name : names) {
    const fs::path file = files / name;
    const Checked read = read_checked(file, kFrames);
    try {
      auto chunk = frames_of(parsed(read.cbor), atlas.keyframes.size());
      require(chunk.size() == FusedFrames::kChunk, "frames are missing");
      frames.push_back(std::make_shared<const FusedFrames::Chunk>(std::move(chunk)));
    } catch (const std::exception& error) {
      throw std::runtime_error(fmt::format("{}: is damaged ({})", file.string(), plain(error.what())));
    }
  }
  for (const FusedFrame& frame : atlas.frames.rest()) frames.push_back(frame);
  return frames;
}

/// Beside state.cbor and the lock, what cairn writes into a session's folder: in this format and in the one before.
bool is_ours(const std::string& name) {
  return run_number(name) || name == kKeyframes ||
         ((name.starts_with("submap-") || name.starts_with("active-")) && name.ends_with(".vdb"));
}

}  // namespace

Options options_of(const Session& session) {
  Options options;
  options.fuse.voxel_size = session.fuse.voxel_size, options.fuse.truncation = session.fuse.truncation;
  options.surface.min_depth = session.min_depth, options.surface.max_depth = session.max_depth;
  return options;
}

ReadSession read_session(const fs::path& session) {
  const fs::path file = session / kState;
  while (true) {
    const Checked state = read_state(session);
    try {
      Session s;
      std::vector<std::string> frame_files;
      try {
        std::tie(s, frame_files) = session_of(state.cbor);
      } catch (const std::exception& error) {
        throw std::runtime_error(fmt::format("{}: is damaged ({}); {}", file.string(), plain(error.what()), kAgain));
      }
      const fs::path files = session / s.run;
      if (!fs::is_directory(files))
        throw std::runtime_error(files.string() + ": is missing; the session is damaged: " + kAgain);
      auto hold = FileLock::take(files, FileLock::Kind::shared, true);
      try {
        BrickTree active = read_bricks(active_file(files, s.number));
        s.back_end.atlas.frames = read_frames(files, frame_files, s.back_end.atlas);
        return {std::move(s), std::move(active), files, state.checksum, std::move(*hold), std::move(frame_files)};
      } catch (const std::exception& error) {
        throw std::runtime_error(std::string(error.what()) + "; the session is damaged: " + kAgain);
      }
    } catch (const std::exception&) {
      // Perhaps somebody has written a newer state meanwhile, and removed what this one names.
      if (read_state(session).checksum == state.checksum) throw;
    }
  }
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
    write_whole(files_ / files.names.back(), with_first_line(frames_json(*chunk), kFrames).first, Durable::some_time);
  }
  return files;
}

void SessionWriter::write(const Session& s, const BrickTree& active) {
  write_bricks(active_file(files_, s.number), active);
  FrameFiles frames = write_frames(s.back_end.atlas.frames, s.number);
  sync_disk(files_);
  Out numbers;
  numbers << s.fused_count << s.repeats << s.lost << s.last_fused.has_value() << s.last_fused.value_or(0)
          << s.acceleration;
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
                   {"run", files_.filename().string()},
                   {"frame_files", frames.names},
                   {"note", s.note}};
  const auto [bytes, sum] = with_first_line(state, kMagic);
  try {
    write_whole(session_ / kState, bytes);
  } catch (const std::exception&) {
    // It may be there all the same, but perhaps not after a power cut.
    is_named_ = is_named_ || names(session_, sum);
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
