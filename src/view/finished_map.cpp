// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/finished_map.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <boost/archive/iterators/base64_from_binary.hpp>
#include <boost/archive/iterators/transform_width.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "base/file_name.hpp"
#include "base/json_text.hpp"
#include "base/path_kind.hpp"
#include "base/quoted.hpp"
#include "base/read_json.hpp"
#include "cairn/mapping/splats.hpp"
#include "cairn/mapping/trajectory.hpp"
#include "net/file_below.hpp"
#include "splats/formats.hpp"
#include "view/downloads.hpp"
#include "view/fields.hpp"
#include "view/first_mesh.hpp"
#include "view/keyframe_pictures.hpp"
#include "view/page_mesh.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kPictureWidth = 640, kPictureQuality = 85;
constexpr int kInlinePictureWidth = 320, kInlinePictureQuality = 65;
constexpr std::size_t kInlinePictures = 40;
constexpr std::size_t kInlineCells = 300'000;         // of fields: 1.2 MB as text
constexpr std::size_t kInlinePictureBytes = 600'000;  // limit for all pictures as text

constexpr std::size_t kMaxReducedBytes = std::size_t{256} << 20;  // of a mesh file: larger ones take minutes
constexpr std::size_t kMaxReportBytes = std::size_t{1} << 30;     // bytes
constexpr std::size_t kMaxItems = 2048;                           // of a list in a page
constexpr std::size_t kReservedBytes = 1 << 15;                   // for the names of a page's mesh

// Text in elements of 64 KiB is parsed in half the time of elements of 1 MiB, and the page is drawn between them.
constexpr std::size_t kElementBytes = 3 << 14, kElementText = kElementBytes / 3 * 4, kTagBytes = 64;

std::string base64(std::string_view bytes) {
  using namespace boost::archive::iterators;
  using Letters = base64_from_binary<transform_width<std::string_view::const_iterator, 6, 8>>;
  std::string text(Letters(bytes.begin()), Letters(bytes.end()));
  text.append((3 - bytes.size() % 3) % 3, '=');
  return text;
}

/// HTML elements with a file; see PageContent.
std::string elements_of(const char* name, std::string_view bytes) {
  std::string html;
  for (; !bytes.empty(); bytes.remove_prefix(std::min(kElementBytes, bytes.size())))
    html += fmt::format("<script type=\"text/plain\" data-of=\"{}\">{}</script>\n", name,
                        base64(bytes.substr(0, kElementBytes)));
  return html;
}

/// Maximum size of a file whose elements have at most `text` bytes.
std::size_t embeddable(std::size_t text) {
  const std::size_t tags = (text / kElementText + 1) * kTagBytes;
  return text > tags ? (text - tags) / 4 * 3 : 0;
}

/// HTML element with the JSON of a page.
std::string data_element(const Json& data) {
  std::string text = text_of(data);
  for (std::size_t at = 0; (at = text.find('<', at)) != text.npos;) text.replace(at, 1, "\\u003c");  // ends no script
  return "<script type=\"application/json\" id=\"data\">" + text + "</script>\n";
}

/// Limits each list to kMaxItems items, at equal intervals. A lost frame replaces the others of its interval.
void thin(Json& json) {
  if (!json.is_structured()) return;
  if (json.is_array() && json.size() > kMaxItems) {
    const auto is_lost = [](const Json& item) {
      return item.is_object() && item.contains("state") && item["state"] == "lost";
    };
    const std::size_t step = (json.size() + kMaxItems - 1) / kMaxItems;
    Json kept = Json::array();
    for (std::size_t i = 0; i < json.size(); i += step) {
      const auto begin = json.begin() + static_cast<std::ptrdiff_t>(i);
      const auto end = json.begin() + static_cast<std::ptrdiff_t>(std::min(i + step, json.size()));
      const auto lost = std::find_if(begin, end, is_lost);
      kept.push_back(std::move(lost == end ? *begin : *lost));
    }
    json = std::move(kept);
  }
  for (Json& item : json) thin(item);
}

Json read_report(const fs::path& folder) {
  const fs::path file = folder / "report.json";
  if (!fs::exists(file) && fs::exists(folder / "session" / "state.cbor"))
    throw std::runtime_error(
        fmt::format("{0}: its run has not finished, or was killed: continue it with cairn reconstruct RECORDING -o {1} "
                    "--resume, or export its map with cairn export {1} -o map.glb and view that file",
                    folder.string(), quoted(folder)));
  if (!fs::exists(file)) {
    if (const PathKind kind = kind_of_path(folder); kind.kind != PathKind::Kind::map)
      throw std::runtime_error(kind.mismatch(folder, "map") + "; give an output folder of cairn");
    throw std::runtime_error(file.string() + ": there is no such file; give an output folder of cairn");
  }
  const std::string bytes = FileBelow(folder, "report.json").read(kMaxReportBytes);
  Json report;
  try {
    report = parsed_json(bytes);
  } catch (const Json::exception& error) {
    throw std::runtime_error(file.string() + ": is damaged: " + plain(error.what()));
  } catch (const TooDeepJson& error) {
    throw std::runtime_error(file.string() + ": is damaged: " + error.what());
  }
  if (!report.is_object()) throw std::runtime_error(file.string() + ": is damaged: it is not a report");
  return report;
}

Json json_of(const Trajectory& path) {
  Json json = Json::array();
  for (const auto& [time, pose] : path) {
    const Eigen::Quaterniond q(pose.linear());
    const Eigen::Vector3d& t = pose.translation();
    json.push_back({time, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()});
  }
  return json;
}

Json json_of(const Download& download, const std::string& url) {
  Json json{{"name", download.name}, {"url", url}, {"what", download.what}};
  if (download.bytes) json["bytes"] = *download.bytes;
  return json;
}

/// Timestamps of the keyframes listed in a report.
std::vector<double> keyframe_times(const Json& report) {
  std::vector<double> times;
  try {
    for (const Json& keyframe : report.value("searched", Json::array())) times.push_back(keyframe.at(0));
  } catch (const Json::exception&) {
    times.clear();  // report of another version
  }
  return times;
}

}  // namespace

Served served_splats(const fs::path& file) {
  const std::string type = content_type_of("splats.spz");
  if (extension_of(file) == ".spz") return {.content_type = type, .body = file};
  return {.content_type = type,
          .body = once([file]() -> Content { return std::make_shared<const Text>(spz_of(read_splats(file))); })};
}

struct FinishedMap::State {
  explicit State(const fs::path& f)
      : folder(f),
        report(read_report(f)),
        has_mesh_file(is_below(f, "mesh.glb")),
        has_preview(is_below(f, "preview.glb")),
        has_grids(is_below(f, "map.vdb")) {
    if (is_below(folder, "trajectory.txt")) path = read_trajectory(folder / "trajectory.txt");
    if (auto found = pictures_of(folder, keyframe_times(report))) pictures.emplace(*std::move(found));
    const auto offset = report.find("clock_offset");
    if (pictures)
      keyframes =
          pictures_along(path, *pictures, offset != report.end() && offset->is_number() ? offset->get<double>() : 0.0);
  }

  /// A run whose mesh could not be written does not show an earlier run's mesh.
  [[nodiscard]] bool has_mesh() const { return report.contains("mesh") && has_mesh_file; }
  [[nodiscard]] bool is_textured() const { return has_mesh() && report["mesh"].contains("textures"); }
  /// Returns true if the page shows a coarser mesh first.
  [[nodiscard]] bool is_large() const {
    if (!has_mesh()) return false;
    const Json& mesh = report["mesh"];
    const auto found = mesh.find("triangles");
    return found != mesh.end() && found->is_number() && found->get<double>() > 2.0 * kFirstTriangles;
  }
  /// The mesh file with less detail.
  [[nodiscard]] fs::path smaller_mesh() const { return folder / (has_preview ? "preview.glb" : "mesh.glb"); }
  [[nodiscard]] bool has_fields() const { return has_grids; }
  /// File with Gaussian splats of the map; empty without one.
  [[nodiscard]] fs::path splats() const {
    for (const char* name : {"splats.spz", "splats.ply"})
      if (is_below(folder, name)) return folder / name;
    return {};
  }
  [[nodiscard]] SensorModel sensor() const { return pictures ? pictures->sensor : SensorModel{}; }
  [[nodiscard]] Json json() const {
    return {{"mode", "finished"},
            {"name", fs::canonical(folder).filename().string()},
            {"report", report},
            {"trajectory", json_of(path)}};
  }
  [[nodiscard]] Json inlined_keyframes() const;
  [[nodiscard]] std::string inlined_mesh(std::size_t max_bytes) const;

  fs::path folder;
  Json report;
  bool has_mesh_file = false, has_preview = false, has_grids = false;  // regular files, not links
  Trajectory path;
  std::optional<SessionPictures> pictures;  // keeps the files open
  std::vector<KeyframePicture> keyframes;
};

FinishedMap::FinishedMap(const fs::path& folder) : state_(std::make_shared<const State>(folder)) {}

std::map<std::string, Served> FinishedMap::served() const {
  const auto s = state_;
  Json data = s->json();
  std::map<std::string, Served> files;
  if (s->has_mesh()) {
    data["mesh"] = "mesh.glb";
    files["mesh.glb"] = {.content_type = content_type_of("mesh.glb"), .body = s->folder / "mesh.glb"};
  }
  if (s->is_large()) {
    data["first"] = kFirstMesh;
    files[kFirstMesh] = served_first_mesh(s->smaller_mesh());
  }
  if (s->has_fields()) {
    data["fields"] = "fields.bin";
    files["fields.bin"] = {
        .content_type = content_type_of("fields.bin"),
        .body = once([s]() -> Content {
          return std::make_shared<const Text>(bytes_of(make_fields(s->folder / "map.vdb", s->sensor(), s->path)));
        }),
        .is_packable = true};
  }
  if (const fs::path file = s->splats(); !file.empty()) {
    data["splats"] = "splats.spz";
    files["splats.spz"] = served_splats(file);
  }
  data["keyframes"] = Json::array();
  for (std::size_t k = 0; k < s->keyframes.size(); ++k) {
    const std::string name = fmt::format("keyframes/{}.jpg", k);
    data["keyframes"].push_back({{"time", s->keyframes[k].time}, {"picture", name}});
    files[name] = {.content_type = content_type_of(name), .body = Make{.make = [s, k]() -> Content {
                                                            return std::make_shared<const Text>(small_picture(
                                                                s->keyframes[k].file, kPictureWidth, kPictureQuality));
                                                          }}};
  }
  data["files"] = Json::array();
  const auto offer = [&](const Download& download, Served file) {
    const std::string url = "files/" + download.name;
    data["files"].push_back(json_of(download, url));
    files[url] = std::move(file);
  };
  for (const Download& file : finished_files(s->folder, s->is_textured()))
    if (file.name != "mesh.glb" || s->has_mesh())
      offer(file, {.content_type = content_type_of(file.name), .body = s->folder / file.name, .download = file.name});
  if (s->has_mesh()) {
    const MadeDownloads made(s->folder / "mesh.glb");
    for (const Download& file : made.list()) offer(file, made.served(file.name));
  }
  files["data.json"] = {.content_type = content_type_of("data.json"), .body = text_of(data), .is_packable = true};
  return files;
}

/// Selects keyframes evenly, as many as the size limit allows.
Json FinishedMap::State::inlined_keyframes() const {
  const std::size_t count = std::min(kInlinePictures, keyframes.size());
  std::vector<std::string> small(count);
  const auto selected = [&](std::size_t i) { return i * keyframes.size() / count; };
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    try {
      small[i] = base64(small_picture(keyframes[selected(i)].file, kInlinePictureWidth, kInlinePictureQuality));
    } catch (const std::exception&) {
      // A missing picture is left out.
    }
  });
  std::size_t bytes = 0;
  for (const std::string& picture : small) bytes += picture.size();
  const std::size_t step = bytes / kInlinePictureBytes + 1;
  Json json = Json::array();
  for (std::size_t i = 0; i < count; i += step)
    if (!small[i].empty())
      json.push_back({{"time", keyframes[selected(i)].time}, {"picture", "data:image/jpeg;base64," + small[i]}});
  return json;
}

/// Mesh of at most `max_bytes`; empty without one.
std::string FinishedMap::State::inlined_mesh(std::size_t max_bytes) const {
  for (const fs::path& file : {folder / "mesh.glb", smaller_mesh()})
    if (fs::file_size(file) <= max_bytes) return FileBelow(folder, file.filename()).read(max_bytes);
  return fs::file_size(smaller_mesh()) <= kMaxReducedBytes ? page_mesh(smaller_mesh(), max_bytes) : std::string();
}

PageContent FinishedMap::inlined(std::size_t max_bytes) const {
  const State& s = *state_;
  PageContent content;
  Json data = s.json();
  thin(data);
  const auto attempt = [](const char* what, const auto& work) {
    try {
      work();
    } catch (const std::exception& error) {
      spdlog::warn(fmt::format("report.html shows no {}: {}", what, error.what()));
    }
  };
  if (s.has_fields())
    attempt("distances", [&] {
      content.rest =
          elements_of("fields", bytes_of(make_fields(s.folder / "map.vdb", s.sensor(), s.path, kInlineCells)));
      data["fields"] = "#fields";
    });
  if (!s.keyframes.empty()) data["keyframes"] = s.inlined_keyframes();
  data["files"] = Json::array();
  for (const Download& file : finished_files(s.folder, s.is_textured()))
    if (file.name != "report.html" && (file.name != "mesh.glb" || s.has_mesh()))
      data["files"].push_back(json_of(file, file.name));
  std::string first;
  if (s.is_large())
    attempt("coarse mesh", [&] {
      first = elements_of("first", first_mesh(s.smaller_mesh()));
      data["first"] = "#first";
    });
  if (s.has_mesh()) {
    const std::size_t others = data_element(data).size() + first.size() + content.rest.size() + kReservedBytes;
    std::string mesh;
    if (others < max_bytes) attempt("mesh", [&] { mesh = s.inlined_mesh(embeddable(max_bytes - others)); });
    if (mesh.empty())
      data["mesh_left_out"] = (s.folder / "mesh.glb").string();
    else
      data.update({{"mesh", "#mesh"}, {"mesh_bytes", mesh.size()}});
    content.rest.insert(0, elements_of("mesh", mesh));
  }
  content.first = data_element(data) + first;
  return content;
}

}  // namespace cairn
