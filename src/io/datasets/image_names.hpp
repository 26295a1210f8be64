// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Order, numbers and times of images from their file names, and the pairing of color with depth images.
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

/// Natural sort order: 2 comes before 10.
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

/// Returns the text in lower case (ASCII only).
[[nodiscard]] std::string lower(std::string text);

/// Returns a folder's files with the given extensions (in lower case, as ".png"; names may have any case), in natural
/// order; empty if the folder does not exist. Skips hidden files and macOS resource forks (._NAME).
[[nodiscard]] std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder,
                                                          std::span<const std::string_view> extensions);
/// Color images: PNG, JPEG, WebP, BMP and TIFF. Files with the same stem are preferred in this order.
[[nodiscard]] std::vector<std::filesystem::path> images_in(const std::filesystem::path& folder);
/// Depth images: PNG, TIFF, EXR, NPY and PGM. Of files with the same stem, NPY is preferred over EXR, TIFF and PNG.
[[nodiscard]] std::vector<std::filesystem::path> depth_images_in(const std::filesystem::path& folder);

/// Describes skipped files, for example "60 files .heic in color are not read": the most common unsupported image or
/// video format among the files not in `taken`; empty if there are none.
[[nodiscard]] std::optional<std::string> skipped_files_in(const std::filesystem::path& folder,
                                                          std::span<const std::filesystem::path> taken);

/// Numbers in the names of a set of images.
struct Numbering {
  enum class Unit { none, frames, seconds, milliseconds, microseconds, nanoseconds };
  Unit unit = Unit::none;                      ///< unit of the number that grows from name to name
  std::vector<double> values;                  ///< by image: seconds or frames; empty for Unit::none
  double step = 0;                             ///< median between images, in the same unit; 0: a single image
  std::vector<std::vector<std::string>> keys;  ///< by image: the numbers that differ within the set
  [[nodiscard]] bool is_time() const { return unit != Unit::none && unit != Unit::frames; }
};
[[nodiscard]] Numbering numbering_of(std::span<const std::filesystem::path> images);
[[nodiscard]] const char* to_string(Numbering::Unit unit);

/// Matches each time to the nearest other time within `max_difference`, or -1: closest pairs first, one to one. Throws
/// std::runtime_error if more times are within the difference than any camera takes.
[[nodiscard]] std::vector<int> associate(std::span<const double> times, std::span<const double> others,
                                         double max_difference);

struct Pairs {
  enum class By { nothing, name, number, time, order };
  By by = By::nothing;
  std::vector<int> color;  ///< by depth image: its color image, -1: none
  int alone = 0;           ///< depth images without a color image
  int color_alone = 0;     ///< color images without a depth image
};
/// Pairs images by equal names, equal numbers or near times; by order if the names have no usable numbers and the
/// counts match. Empty if no rule applies.
[[nodiscard]] std::optional<Pairs> pair_images(std::span<const std::filesystem::path> depth,
                                               const Numbering& depth_names,
                                               std::span<const std::filesystem::path> color,
                                               const Numbering& color_names);
[[nodiscard]] const char* to_string(Pairs::By by);

}  // namespace cairn
