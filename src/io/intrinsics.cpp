// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/intrinsics.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <stdexcept>
#include <vector>

#include "base/file_name.hpp"
#include "base/lines.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "cairn/io/known_cameras.hpp"
#include "io/datasets/image_names.hpp"
#include "io/datasets/other_cameras.hpp"
#include "io/json_fields.hpp"
#include "options/yaml_file.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;
constexpr double kMaxSkew = 1e-3;              // share of fx
constexpr std::size_t kMaxTextSize = 1 << 16;  // bytes of a small text file
constexpr const char* kJson = "width, height, fx, fy, cx, cy and depth_scale (units per meter)";
constexpr const char* kText = "a 3x3 or 4x4 matrix, `fx fy cx cy`, or lines such as `fx: 525`";

/// Files of phone apps. Other programs use the same names for other content, so only files with a camera in them are
/// used.
constexpr std::array kOptionalFiles{"metadata.json", "info.json"};
constexpr const char* kFrameJson = "frame_";  // frame_00000.json of 3D Scanner App

/// In lower case; the first existing file is used.
constexpr std::array kFiles{"camera.yaml",
                            "camera.yml",
                            "intrinsics.json",
                            "intrinsic.json",
                            "camera_intrinsic.json",
                            "camera_intrinsics.json",
                            "camera-intrinsics.json",
                            "camera_primesense.json",
                            "camera.json",
                            "camera_info.yaml",
                            "camera_info.yml",
                            "intrinsics.yaml",
                            "intrinsics.yml",
                            "calibration.yaml",
                            "calib.yaml",
                            "ost.yaml",
                            "intrinsics.txt",
                            "intrinsic.txt",
                            "camera-intrinsics.txt",
                            "camera_intrinsics.txt",
                            "camera_intrinsic.txt",
                            "camera.txt",
                            "k.txt",
                            "cam_k.txt",
                            "calibration.txt",
                            "calib.txt",
                            "depth_intrinsics.txt",
                            "intrinsics_depth.txt",
                            "intrinsic_depth.txt"};

/// Aliases of keys in files of other programs.
constexpr std::array<std::pair<std::string_view, std::string_view>, 14> kNames{{{"w", "width"},
                                                                                {"image_width", "width"},
                                                                                {"h", "height"},
                                                                                {"image_height", "height"},
                                                                                {"fl_x", "fx"},
                                                                                {"f_x", "fx"},
                                                                                {"focal_x", "fx"},
                                                                                {"fl_y", "fy"},
                                                                                {"f_y", "fy"},
                                                                                {"focal_y", "fy"},
                                                                                {"c_x", "cx"},
                                                                                {"ppx", "cx"},
                                                                                {"c_y", "cy"},
                                                                                {"ppy", "cy"}}};
std::string_view canonical_name(std::string_view name) {
  const auto* const it = std::find_if(kNames.begin(), kNames.end(), [&](const auto& n) { return n.first == name; });
  return it == kNames.end() ? name : it->second;
}

/// Reads fx, fy, cx and cy from a matrix of 3x3 or 4x4 numbers, row-major or, as written by Open3D, column-major.
void parse_matrix(const std::vector<double>& m, const char* name, Camera& camera) {
  if (m.size() != 9 && m.size() != 16) throw std::runtime_error(fmt::format("`{}` takes 9 numbers", name));
  const std::size_t n = m.size() == 9 ? 3 : 4;
  const auto at = [&](std::size_t r, std::size_t c) { return m[n * r + c]; };
  const bool by_column = at(0, 2) == 0 && at(1, 2) == 0 && (at(2, 0) != 0 || at(2, 1) != 0);
  const auto k = [&](std::size_t r, std::size_t c) { return by_column ? at(c, r) : at(r, c); };
  if (!(k(2, 2) == 1 && k(2, 0) == 0 && k(2, 1) == 0 && k(1, 0) == 0 &&
        std::abs(k(0, 1)) <= kMaxSkew * std::abs(k(0, 0))))
    throw std::runtime_error(fmt::format("`{}` is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]", name));
  camera.fx = k(0, 0), camera.fy = k(1, 1), camera.cx = k(0, 2), camera.cy = k(1, 2);
}

void parse_distortion(const std::vector<double>& terms, const char* name, Camera& camera) {
  if (terms.size() != 5 && terms.size() != 8)
    throw std::runtime_error(fmt::format("`{}` takes [k1, k2, p1, p2, k3], optionally followed by k4, k5, k6", name));
  std::copy(terms.begin(), terms.end(), camera.distortion.begin());
}

/// Flattens a list, or list of lists, of numbers; empty if an entry has another type.
std::optional<std::vector<double>> numbers_of(const Json& list) {
  std::vector<double> numbers;
  if (!list.is_array()) return std::nullopt;
  for (const Json& item : list) {
    if (item.is_number()) {
      numbers.push_back(item.get<double>());
    } else if (const auto inner = item.is_array() ? numbers_of(item) : std::nullopt) {
      numbers.insert(numbers.end(), inner->begin(), inner->end());
    } else {
      return std::nullopt;
    }
  }
  return numbers;
}

const char* matrix_in(const Json& json) {
  for (const char* name : {"intrinsic_matrix", "camera_matrix", "K", "k", "intrinsic", "intrinsics", "matrix"})
    if (const auto it = json.find(name); it != json.end() && it->is_array()) return name;
  return nullptr;
}

Json with_canonical_names(const Json& json) {
  Json canonical = Json::object();
  for (const auto& [name, value] : json.items()) canonical[std::string(canonical_name(name))] = value;
  return canonical;
}

void parse_lens(const Json& json, Camera& camera) {
  for (const char* name : {"distortion", "coeffs"}) {
    const auto it = json.find(name);
    if (it == json.end()) continue;
    parse_distortion(numbers_of(*it).value_or(std::vector<double>{}), name, camera);
    const std::string model =
        json.contains("model") && json["model"].is_string() ? lower(json["model"].get<std::string>()) : "";
    if (camera.distorted() && name != std::string_view("distortion") &&
        (model.find("brown") == model.npos || model.find("inverse") != model.npos))
      throw std::runtime_error(fmt::format("`model` '{}' of the lens is unknown; write camera.yaml", shown(model)));
  }
}

void parse_json(const Json& given, Intrinsics& result) {
  const Json* from = &given;
  for (const char* name : {"intrinsic", "intrinsics", "camera", "depth"})  // parent objects in files of other programs
    if (const auto it = given.find(name);
        from == &given && !given.contains("fx") && it != given.end() && it->is_object())
      from = &*it;
  const Json json = with_canonical_names(*from);
  CameraFile& file = result.camera;
  Camera& c = file.rig.depth;
  file.has_size = json.contains("width") || json.contains("height");
  if (file.has_size) c.width = pixels_at(json, "width"), c.height = pixels_at(json, "height");
  if (const char* matrix = matrix_in(json)) {
    const auto numbers = numbers_of(json[matrix]);
    parse_matrix(numbers.value_or(std::vector<double>{}), matrix, c);
    result.is_open3d = matrix == std::string_view("intrinsic_matrix");
  } else {
    c.fx = number_at(json, "fx"), c.fy = number_at(json, "fy"), c.cx = number_at(json, "cx"),
    c.cy = number_at(json, "cy");
  }
  parse_lens(json, c);
  if (file.has_size) check(c);
  if (json.contains("depth_scale")) {
    file.depth_scale = number_at(json, "depth_scale");
    check_depth_scale(*file.depth_scale);
  }
  for (const char* name : {"frame_rate", "fps"})  // `fps` is Record3D's
    if (json.contains(name) && !file.frame_rate) file.frame_rate = number_at(json, name);
  if (file.frame_rate) check_frame_rate(*file.frame_rate);
}

/// Splits a text into words and numbers at brackets and commas.
std::vector<std::string> words_of(const fs::path& file) {
  std::error_code ignored;
  if (fs::file_size(file, ignored) > kMaxTextSize && !ignored)
    throw std::runtime_error(fmt::format("is too long; expected {}", kText));
  const auto bytes = read_whole(file, kMaxTextSize);
  std::vector<std::string> words;
  std::string word;
  bool comment = false;
  const auto end_word = [&] {
    if (!word.empty()) words.push_back(std::move(word));
    word.clear();
  };
  for (const std::uint8_t byte : bytes) {
    const char c = static_cast<char>(byte);
    comment = c != '\n' && (comment || c == '#');
    if (comment || c <= ' ' || std::string_view("[](){},;:=\"'").find(c) != std::string_view::npos)
      end_word();
    else
      word += c;
  }
  end_word();
  return words;
}

void parse_words(const std::vector<std::string>& words, Intrinsics& result) {
  CameraFile& file = result.camera;
  Camera& c = file.rig.depth;
  file.has_size = false;
  std::vector<double> numbers;
  std::map<std::string, double, std::less<>> named;
  for (std::size_t i = 0; i < words.size(); ++i) {
    if (const auto number = number_in(words[i])) {
      numbers.push_back(*number);
    } else if (i + 1 < words.size() && (i == 0 || canonical_name(lower(words[i - 1])) != "cx")) {  // not a header
      if (const auto value = number_in(words[i + 1])) named[std::string(canonical_name(lower(words[i])))] = *value, ++i;
    }
  }
  const auto is_named = [&](const char* name) { return named.find(name) != named.end(); };
  const auto size = [](double pixels) { return pixels >= 0 && pixels <= 1e6 ? static_cast<int>(pixels) : -1; };
  if (is_named("fx") && is_named("fy") && is_named("cx") && is_named("cy")) {
    c.fx = named["fx"], c.fy = named["fy"], c.cx = named["cx"], c.cy = named["cy"];
    file.has_size = is_named("width") && is_named("height");
    if (file.has_size) c.width = size(named["width"]), c.height = size(named["height"]);
    if (is_named("depth_scale")) file.depth_scale = named["depth_scale"];
    std::vector<double> terms;
    for (const char* name : {"k1", "k2", "p1", "p2", "k3"}) terms.push_back(is_named(name) ? named[name] : 0);
    parse_distortion(terms, "distortion", c);
  } else if (numbers.size() == 9 || numbers.size() == 16) {
    parse_matrix(numbers, "the matrix", c);
  } else if (numbers.size() == 4) {
    c.fx = numbers[0], c.fy = numbers[1], c.cx = numbers[2], c.cy = numbers[3];
  } else {
    throw std::runtime_error(fmt::format("has {} numbers; expected {}", numbers.size(), kText));
  }
  if (file.depth_scale) check_depth_scale(*file.depth_scale);
  if (file.has_size) check(c);
}

CameraFile read_yaml(const fs::path& path) {
  try {
    const YAML::Node y = read_yaml_file(path);
    if (const auto settings = orb_slam_camera(y)) return *settings;
    if (y.IsMap() && (y["camera_matrix"] || y["K"] || y["k"])) return {.rig = camera_of_ros(y)};
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(path.string() + ":" + std::to_string(error.mark.line + 1) + ": " + shown(error.msg));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(path.string() + ": " + error.what());
  }
  return read_camera_file(path);
}

std::vector<double> list_of(const YAML::Node& y, const char* name) {
  const YAML::Node data = y[name].IsMap() ? y[name]["data"] : y[name].IsSequence() ? y[name] : YAML::Node();
  if (!data) throw std::runtime_error(fmt::format("`{}` is missing, or has no `data`", name));
  return data.as<std::vector<double>>();
}

/// Returns the first of the names that exists.
const char* one_of(const YAML::Node& y, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (y[name]) return name;
  return nullptr;
}

/// Reads fx, fy, cx and cy from the left 3x3 numbers of a row-major matrix. Throws if an entry that should be zero is
/// not.
void parse_rows(const std::vector<double>& m, const char* name, Camera& camera) {
  const std::size_t columns = m.size() / 3;
  const auto k = [&](std::size_t r, std::size_t c) { return m[columns * r + c]; };
  if (!(k(2, 2) == 1 && k(2, 0) == 0 && k(2, 1) == 0 && k(1, 0) == 0 &&
        std::abs(k(0, 1)) <= kMaxSkew * std::abs(k(0, 0))))
    throw std::runtime_error(fmt::format("`{}` is not [fx, 0, cx, 0, fy, cy, 0, 0, 1]", name));
  camera.fx = k(0, 0), camera.fy = k(1, 1), camera.cx = k(0, 2), camera.cy = k(1, 2);
}

/// RTAB-Map writes zeros into camera_matrix for rectified images; projection_matrix then holds the camera. Returns
/// false for other files.
bool parse_projection(const YAML::Node& y, const std::vector<double>& k, Camera& camera) {
  const char* name = one_of(y, {"projection_matrix", "P", "p"});
  if (k[4] != 0 || k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || name == nullptr) return false;
  const auto p = list_of(y, name);
  if (p.size() != 12) throw std::runtime_error(fmt::format("`{}` takes 12 numbers", name));
  parse_rows(p, name, camera);
  return true;
}

/// True for the format of COLMAP's cameras.txt under any name: `1 PINHOLE 640 480 ...`.
bool is_colmap(const fs::path& file) {
  bool is_first = true, is_model = false;
  std::error_code ignored;
  if (fs::file_size(file, ignored) > kMaxTextSize || ignored) return file.filename() == "cameras.txt";
  for_each_line(file, [&](int, const std::vector<std::string>& words) {
    if (is_first)
      is_model = words.size() > 4 && number_in<int>(words[0]) &&
                 words[1].find_first_not_of("ABCDEFGHIJKLMNOPQRSTUVWXYZ_") == words[1].npos;
    is_first = false;
  });
  return is_model || file.filename() == "cameras.txt";
}

bool has_camera(const fs::path& file) {
  try {
    (void)read_intrinsics(file);
    return true;
  } catch (const std::runtime_error&) {
    return false;
  }
}

/// True if the camera files have a single meaning; of several ORB-SLAM settings, the right file is unknown.
bool is_unambiguous(const std::vector<fs::path>& files) {
  return files.size() == 1 || files[0].filename() == "cameras.txt";
}

}  // namespace

Camera camera_of_ros(const YAML::Node& y) {
  if (!y.IsMap()) throw std::runtime_error("expected lines such as `image_width: 640`");
  const char *width = one_of(y, {"image_width", "width"}), *height = one_of(y, {"image_height", "height"}),
             *matrix = one_of(y, {"camera_matrix", "K", "k"}),
             *terms = one_of(y, {"distortion_coefficients", "D", "d"});
  for (const auto& [name, canonical] :
       {std::pair{width, "image_width"}, {height, "image_height"}, {matrix, "camera_matrix"}})
    if (name == nullptr) throw std::runtime_error(fmt::format("`{}` is missing", canonical));
  Camera camera{.width = y[width].as<int>(), .height = y[height].as<int>()};
  const auto k = list_of(y, matrix);
  if (k.size() != 9) throw std::runtime_error(fmt::format("`{}` takes 9 numbers", matrix));
  const bool is_rectified = parse_projection(y, k, camera);
  if (!is_rectified) parse_rows(k, matrix, camera);
  if (terms != nullptr && !is_rectified) {
    auto d = list_of(y, terms);
    const auto model = y["distortion_model"] ? y["distortion_model"].as<std::string>() : "";
    const bool fisheye = model == "fisheye" || model == "equidistant";
    if (fisheye && d.size() == 6) d = {d[0], d[1], d[4], d[5]};  // k1 k2 p1 p2 k3 k4 with p = 0
    if (fisheye ? d.size() != 4 : !d.empty() && d.size() != 4 && d.size() != 5 && d.size() != 8)
      throw std::runtime_error(fmt::format("`{}` has {} numbers; expected 4, 5 or 8", terms, d.size()));
    std::copy(d.begin(), d.end(), camera.distortion.begin());
    if (fisheye) camera.lens = Lens::fisheye;
  }
  check(camera);
  return camera;
}

std::optional<fs::path> intrinsics_file(const fs::path& folder) {
  std::map<std::string, fs::path> present;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (!entry.is_directory(ignored)) present.emplace(lower(entry.path().filename().string()), entry.path());
  for (const char* name : kFiles)
    if (const auto it = present.find(name); it != present.end()) return it->second;
  if (const auto others = other_camera_files(folder); !others.empty() && is_unambiguous(others)) return others[0];
  for (const char* name : kOptionalFiles)
    if (const auto it = present.find(name); it != present.end() && has_camera(it->second)) return it->second;
  // This app's camera changes slightly with the focus; the first frame's is used.
  if (const auto it = present.lower_bound(kFrameJson); it != present.end() && it->first.starts_with(kFrameJson) &&
                                                       it->first.ends_with(".json") && has_camera(it->second))
    return it->second;
  // Layout of unpacked ScanNet images, and of 3DMatch, where sequences share a camera.
  for (const auto& file : {folder / "intrinsic" / "intrinsic_depth.txt",
                           fs::absolute(folder).lexically_normal() / "../camera-intrinsics.txt"})
    if (fs::exists(file, ignored)) return file;
  return std::nullopt;
}

Intrinsics read_intrinsics(const fs::path& file) {
  const std::string extension = extension_of(file);
  Intrinsics result;
  if (extension == ".json") {
    read_json(file, kJson, [&](const Json& json) { parse_json(json, result); });
  } else if (extension == ".txt") {
    try {
      if (is_colmap(file))
        result.camera = colmap_camera(file);
      else
        parse_words(words_of(file), result);
    } catch (const std::runtime_error& error) {
      throw std::runtime_error(file.string() + ": " + error.what());
    }
  } else if (extension == ".bin") {
    throw std::runtime_error(
        file.string() + ": is binary; write COLMAP's model as text with `colmap model_converter --output_type TXT`");
  } else {
    result.camera = read_yaml(file);
  }
  return result;
}

std::string unused_cameras_in(const fs::path& folder) {
  constexpr std::array kWords{"cam", "calib", "intrin"};
  constexpr std::array<std::string_view, 8> kKinds{".yaml", ".yml", ".json", ".txt", ".xml", ".bin", ".ini", ".cfg"};
  std::vector<fs::path> files = other_camera_files(folder);
  std::string words;
  if (files.size() > 1) {
    for (const fs::path& file : files) words += (words.empty() ? "" : " and ") + file.filename().string();
    return words + " each have a camera: give one of them with --camera; ";
  }
  for (const auto& file : files_in(folder, kKinds)) {
    const std::string name = lower(file.filename().string());
    if (std::none_of(kWords.begin(), kWords.end(), [&](const char* w) { return name.find(w) != name.npos; })) continue;
    try {
      (void)read_intrinsics(file);
      words += fmt::format("{} has one, give it with --camera; ", file.filename().string());
    } catch (const std::runtime_error& error) {
      words += fmt::format("{}; ", error.what());
    }
    break;  // the first error is enough
  }
  return words;
}

std::string how_to_give_the_camera(const fs::path& folder, const Camera& example) {
  std::vector<std::string_view> names;
  for (const KnownCamera& camera : known_cameras()) names.push_back(camera.name);
  return fmt::format(
      "write its intrinsics into {}, such as {{width: {}, height: {}, fx: {}, fy: {}, cx: {}, cy: {}, depth_scale: "
      "1000}}, "
      "or give --camera FILE or NAME ({})",
      (folder / "camera.yaml").string(), example.width, example.height, example.fx, example.fy, example.cx, example.cy,
      fmt::join(names, ", "));
}

}  // namespace cairn
