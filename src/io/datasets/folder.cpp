// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// User folders of images: depth and color in separate folders or in the same one, paired by file name, with the camera
// in a file in the folder. Also the output of Open3D's recorders (Zhou et al. 2018).
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>
#include <stdexcept>

#include "base/depth_image.hpp"
#include "base/file_name.hpp"
#include "base/lines.hpp"
#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "geometry/pose_matrix.hpp"
#include "io/datasets/image_names.hpp"
#include "io/intrinsics.hpp"
#include "io/recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;
constexpr double kFrameRate = 30;  // Hz, if neither names nor files define a rate

// In lower case, most likely first.
constexpr std::array kDepthFolders{"depth"sv,        "depths"sv,      "depth_raw"sv,  "raw_depth"sv,
                                   "depth_images"sv, "depth_image"sv, "depth_maps"sv, "depthmaps"sv};
constexpr std::array kColorFolders{"color"sv,   "colour"sv,     "rgb"sv,          "images"sv, "image"sv, "colors"sv,
                                   "colours"sv, "rgb_images"sv, "color_images"sv, "img"sv,    "imgs"sv};
// Words in names of images that are neither depth nor color.
constexpr std::array kOtherWords{"mask"sv, "label"sv, "normal"sv, "vis"sv, "seg"sv, "infra"sv, "conf"sv, "preview"sv};
constexpr std::array kColorWords{"rgb"sv, "color"sv, "colour"sv, "image"sv, "img"sv};

template <class Words>
bool contains_any(const std::string& name, const Words& words) {
  return std::any_of(words.begin(), words.end(), [&](std::string_view word) { return name.find(word) != name.npos; });
}

struct Images {
  fs::path depth_folder, color_folder;
  std::vector<fs::path> depth, color;
  std::vector<std::string> skipped;  // files of unsupported formats, a line for each folder
};

/// Returns the first folder from `names` that holds images, else the first with any of `words` in its name.
template <class Names, class Words, class List>
std::pair<fs::path, std::vector<fs::path>> find_folder(const std::map<std::string, fs::path>& folders,
                                                       const Names& names, const Words& words, bool is_depth,
                                                       List&& list) {
  for (const std::string_view name : names)
    if (const auto it = folders.find(std::string(name)); it != folders.end())
      if (auto images = list(it->second); !images.empty()) return {it->second, std::move(images)};
  for (const auto& [name, folder] : folders)
    if (contains_any(name, words) && !contains_any(name, kOtherWords) && is_depth == (name.find("depth") != name.npos))
      if (auto images = list(folder); !images.empty()) return {folder, std::move(images)};
  return {};
}

bool is_tiff_name(const fs::path& file) { return extension_of(file) == ".tif" || extension_of(file) == ".tiff"; }

/// Splits images into depth and color by names with `depth` in them, else by pixel type.
void split_images(const fs::path& folder, Images& images) {
  const auto is_depth = [](const fs::path& file) {
    const std::string stem = lower(file.stem().string());
    return stem.find("depth") != stem.npos && !contains_any(stem, kOtherWords);
  };
  images.depth = depth_images_in(folder);
  if (std::any_of(images.depth.begin(), images.depth.end(), is_depth)) {
    std::erase_if(images.depth, [&](const fs::path& file) { return !is_depth(file); });
  } else {
    // Decodes one file of each name pattern.
    std::map<std::string, bool> patterns;
    std::erase_if(images.depth, [&](const fs::path& file) {
      std::string pattern = file.filename().string();
      std::erase_if(pattern, [](char c) { return c >= '0' && c <= '9'; });
      auto [it, is_new] = patterns.emplace(pattern, false);
      if (is_new) {
        try {
          const cv::Mat image = decode_depth(read_whole(file));
          it->second = image.type() == CV_16UC1 || image.type() == CV_32FC1;
        } catch (const std::exception&) {
          patterns.erase(it);  // decide by the next file
          return true;
        }
      }
      return !it->second;
    });
  }
  if (images.depth.empty()) return;
  images.color = images_in(folder);
  const std::set<fs::path> taken(images.depth.begin(), images.depth.end());
  std::erase_if(images.color, [&](const fs::path& file) {
    return taken.contains(file) || contains_any(lower(file.stem().string()), kOtherWords) ||
           lower(file.stem().string()).find("depth") != std::string::npos;
  });
  // Depth stored as TIFF as well must not count as color.
  if (std::any_of(images.color.begin(), images.color.end(), [](const fs::path& file) { return !is_tiff_name(file); }))
    std::erase_if(images.color, is_tiff_name);
  const auto is_named = [](const fs::path& file) { return contains_any(lower(file.stem().string()), kColorWords); };
  if (std::any_of(images.color.begin(), images.color.end(), is_named))
    std::erase_if(images.color, [&](const fs::path& file) { return !is_named(file); });
  images.depth_folder = images.color_folder = folder;
}

/// Adds a line for each folder of depth or color with files of an unsupported format.
void note_skipped(const std::map<std::string, fs::path>& folders, Images& images) {
  const auto note = [&](const fs::path& folder, const std::vector<fs::path>& taken, const char* remedy) {
    const auto words = skipped_files_in(folder, taken);
    if (words) images.skipped.push_back(fmt::format("{}: {}", *words, remedy));
    return words.has_value();
  };
  constexpr const char* kConvert = "convert them to PNG or JPEG";
  note(images.depth_folder, images.depth, "convert them to 16-bit PNG, TIFF or NPY");
  if (!images.color.empty()) {
    note(images.color_folder, images.color, kConvert);
    return;
  }
  for (const std::string_view name : kColorFolders)
    if (const auto it = folders.find(std::string(name)); it != folders.end() && note(it->second, {}, kConvert)) return;
}

Images find_images(const fs::path& folder) {
  std::map<std::string, fs::path> folders;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder))
    if (const auto name = entry.path().filename().string(); entry.is_directory(ignored) && !name.starts_with('.'))
      folders.emplace(lower(name), entry.path());
  Images images;
  std::tie(images.depth_folder, images.depth) =
      find_folder(folders, kDepthFolders, std::array{"depth"sv}, true, depth_images_in);
  if (images.depth.empty()) {
    split_images(folder, images);
  } else {
    std::tie(images.color_folder, images.color) = find_folder(folders, kColorFolders, kColorWords, false, images_in);
    note_skipped(folders, images);
  }
  return images;
}

/// Describes the other files in a folder by extension: "20 files .raw".
std::string describe_files(const fs::path& folder) {
  std::map<std::string, int> extensions;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (!entry.is_directory(ignored)) ++extensions[extension_of(entry.path())];
  const auto largest = std::max_element(extensions.begin(), extensions.end(),
                                        [](const auto& a, const auto& b) { return a.second < b.second; });
  if (largest == extensions.end()) return "it is empty";
  return fmt::format("it has {} files {}", largest->second,
                     largest->first.empty() ? "without an extension" : shown(largest->first));
}

/// Throws if a depth folder has no readable image, instead of searching further.
void reject_empty_depth(const fs::path& folder) {
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder))
    if (lower(entry.path().filename().string()) == "depth" && entry.is_directory(ignored))
      throw std::runtime_error(fmt::format("{}: has no PNG, TIFF, EXR, NPY or PGM image; {}", entry.path().string(),
                                           describe_files(entry.path())));
}

/// Returns the images' format in capitals, for example "PNG".
std::string kind_of(const std::vector<fs::path>& images) {
  std::string extension = images.empty() ? "" : extension_of(images[0]);
  if (!extension.empty()) extension.erase(0, 1);
  for (char& c : extension) c = static_cast<char>(std::toupper(c));
  return extension;
}

/// Reads row-major poses next to the images: frame-000012.pose.txt of frame-000012.depth.png, or pose/12.txt of
/// depth/12.png.
void add_truth(const fs::path& folder, Recording& recording) {
  std::error_code ignored;
  const fs::path poses = fs::is_directory(folder / "poses", ignored) ? folder / "poses" : folder / "pose";
  const bool has_folder = fs::is_directory(poses, ignored);
  for (const auto& entry : recording.entries) {
    std::string stem = entry.depth.stem().string();
    if (stem.ends_with(".depth")) stem.resize(stem.size() - 6);
    const fs::path file = has_folder ? poses / (stem + ".txt") : entry.depth.parent_path() / (stem + ".pose.txt");
    if (!fs::exists(file, ignored)) continue;
    std::vector<double> numbers;
    for_each_line(file, [&](int, const std::vector<std::string>& words) {
      for (const auto& word : words) numbers.push_back(number_in(word).value_or(NAN));
    });
    const auto pose = numbers.size() == 16 ? pose_of_rows(numbers) : std::nullopt;  // ScanNet: -inf if missing
    if (pose) recording.truth.push_back({entry.timestamp, *pose});
  }
}

void set_entries(const Images& images, Recording& recording) {
  const auto names = numbering_of(images.depth), colors = numbering_of(images.color);
  const auto pairs = pair_images(images.depth, names, images.color, colors);
  const auto relative = [&](const fs::path& file) { return file.parent_path().filename() / file.filename(); };
  if (!pairs)
    throw std::runtime_error(fmt::format(
        "{}: no color image matches a depth image by name ({} and {}): give both the same name or number, or times in "
        "one clock",
        images.color_folder.string(), relative(images.depth[0]).string(), relative(images.color[0]).string()));
  const bool numbered = names.unit != Numbering::Unit::none;
  const double first = !numbered || names.is_time() ? 0 : *std::min_element(names.values.begin(), names.values.end());
  for (std::size_t i = 0; i < images.depth.size(); ++i) {
    const double time =
        names.is_time() ? names.values[i] : (numbered ? names.values[i] - first : static_cast<double>(i)) / kFrameRate;
    Recording::Entry entry{.timestamp = time, .depth = images.depth[i]};
    if (const int c = pairs->color[i]; c >= 0) {
      entry.color = images.color[static_cast<std::size_t>(c)];
      if (pairs->by == Pairs::By::time) entry.color_delay = colors.values[static_cast<std::size_t>(c)] - time;
    }
    recording.entries.push_back(std::move(entry));
  }
  std::stable_sort(recording.entries.begin(), recording.entries.end(),
                   [](const auto& a, const auto& b) { return a.timestamp < b.timestamp; });
  const auto add = [&](const char* what, std::string words) {
    recording.interpretations.push_back({what, std::move(words)});
  };
  add("images", fmt::format("{} depth images ({}) in {}, {}", images.depth.size(), kind_of(images.depth),
                            images.depth_folder.string(),
                            images.color.empty() ? "no color"
                                                 : fmt::format("{} color images ({}) in {}", images.color.size(),
                                                               kind_of(images.color), images.color_folder.string())));
  if (!images.color.empty())
    add("pairing", fmt::format("by {}; {} depth and {} color images are unpaired", to_string(pairs->by), pairs->alone,
                               pairs->color_alone));
  add("times", names.is_time() ? fmt::format("{} in the names", to_string(names.unit))
               : numbered      ? "frame numbers in the names"
                               : "in the order of the names");
  if (!names.is_time()) recording.frame_rate = kFrameRate;
  if (pairs->by == Pairs::By::order && images.depth.size() > 1)
    recording.warnings.push_back("the names do not match color images to depth images: they are paired in order");
  if (images.color.empty() || pairs->by == Pairs::By::order) return;
  if (pairs->alone > 0) {
    const auto it =
        std::find_if(recording.entries.begin(), recording.entries.end(), [](const auto& e) { return e.color.empty(); });
    recording.warnings.push_back(
        fmt::format("{} of {} frames have depth only: the color image is missing (first: frame {}, {})", pairs->alone,
                    recording.entries.size(), it - recording.entries.begin(), relative(it->depth).string()));
  }
  if (pairs->color_alone > 0 && pairs->by != Pairs::By::time) {
    std::vector<bool> taken(images.color.size());
    for (const int c : pairs->color)
      if (c >= 0) taken[static_cast<std::size_t>(c)] = true;
    const auto at = static_cast<std::size_t>(std::find(taken.begin(), taken.end(), false) - taken.begin());
    recording.warnings.push_back(
        fmt::format("{} of {} color images are not used: the depth image is missing (first: {})", pairs->color_alone,
                    images.color.size(), relative(images.color[at]).string()));
  }
}

}  // namespace

std::optional<Recording> read_image_folder(const fs::path& folder) {
  const auto file = intrinsics_file(folder);
  const Images images = find_images(folder);
  if (images.depth.empty()) reject_empty_depth(folder);
  if (images.depth.empty() && !file) return std::nullopt;
  Recording recording;
  recording.layout = "folder of images";
  recording.is_plain = true;
  recording.has_depth_scale = false;
  recording.invalid_depth = 65535;
  recording.camera_is_missing = true;
  if (file && lower(file->filename().string()) == "intrinsics.json") recording.layout = "folder with intrinsics.json";
  if (images.depth.empty())
    throw std::runtime_error(
        fmt::format("{}: has {}, but no depth images; expected depth images in depth, depths or depth_raw, or with "
                    "`depth` in their names",
                    folder.string(), file->filename().string()));
  set_entries(images, recording);
  recording.warnings.insert(recording.warnings.end(), images.skipped.begin(), images.skipped.end());
  add_truth(folder, recording);
  return recording;
}

std::optional<Recording> read_intrinsics_folder(const fs::path& folder) {
  return fs::exists(folder / "intrinsics.json") ? read_image_folder(folder) : std::nullopt;
}

}  // namespace cairn
