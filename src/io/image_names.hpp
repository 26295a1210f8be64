// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// What names of images tell in folders as people have them: their order, their numbers and times, and which colour
// image belongs to which depth image.
#pragma once
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace cairn {

/// The order of people: 2 comes before 10.
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

/// The text in lower case, of ASCII.
[[nodiscard]] std::string lower(std::string text);

/// Files of a folder with one of these extensions (in lower case, as ".png"; names may have any case), in natural
/// order; none where there is no such folder. Hidden files and what macOS leaves beside them (._NAME) are no images.
[[nodiscard]] std::vector<std::filesystem::path> files_in(const std::filesystem::path& folder,
                                                          std::span<const std::string_view> extensions);
/// Of color: PNG, JPEG, WebP, BMP and TIFF. Of several with one stem, they go in this order.
[[nodiscard]] std::vector<std::filesystem::path> images_in(const std::filesystem::path& folder);
/// What depth can be: PNG, TIFF, EXR, NPY and PGM. Of several with one stem, NPY goes before EXR before TIFF before
/// PNG.
[[nodiscard]] std::vector<std::filesystem::path> depth_images_in(const std::filesystem::path& folder);

/// "60 files .heic in color are not read": of the kind of image or video that most of a folder's files beside `taken`
/// have and no reader knows; nothing where there are none.
[[nodiscard]] std::optional<std::string> passed_over_in(const std::filesystem::path& folder,
                                                        std::span<const std::filesystem::path> taken);

/// What stands in the names of a set of images.
struct Numbering {
  enum class Unit { none, frames, seconds, milliseconds, microseconds, nanoseconds };
  Unit unit = Unit::none;                      ///< of what grows from name to name
  std::vector<double> values;                  ///< by image: seconds, or frames; empty for none
  double step = 0;                             ///< between images, the median, in the same unit; 0: a single one
  std::vector<std::vector<std::string>> keys;  ///< by image: the numbers that differ within the set
  [[nodiscard]] bool is_time() const { return unit != Unit::none && unit != Unit::frames; }
};
[[nodiscard]] Numbering numbering_of(std::span<const std::filesystem::path> images);
[[nodiscard]] const char* name_of(Numbering::Unit unit);

/// For each of some times the nearest other one within a difference, or -1: the closest pairs first, one to one. Throws
/// std::runtime_error where more others lie within it than any camera takes.
[[nodiscard]] std::vector<int> associate(std::span<const double> times, std::span<const double> others,
                                         double most_difference);

struct Pairs {
  enum class By { nothing, name, number, time, order };
  By by = By::nothing;
  std::vector<int> colour;  ///< by depth image: its colour image, -1: none
  int alone = 0;            ///< depth images without one
  int colour_alone = 0;     ///< colour images without a depth image
};
/// By equal names, equal numbers or near times; by order where names tell nothing and there are as many of both.
/// Nothing where no way is left.
[[nodiscard]] std::optional<Pairs> pair_images(std::span<const std::filesystem::path> depth,
                                               const Numbering& depth_names,
                                               std::span<const std::filesystem::path> colour,
                                               const Numbering& colour_names);
[[nodiscard]] const char* name_of(Pairs::By by);

}  // namespace cairn
