// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/image_names.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <numeric>
#include <stdexcept>
#include <tuple>

#include "base/file_name.hpp"
#include "base/median.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

constexpr std::array kColor{".png"sv, ".jpg"sv, ".jpeg"sv, ".webp"sv, ".bmp"sv, ".tiff"sv, ".tif"sv};  // best first
constexpr std::array kUnsupported{".heic"sv, ".heif"sv, ".avif"sv, ".jxl"sv, ".jp2"sv, ".gif"sv, ".ppm"sv, ".pgm"sv,
                                  ".pnm"sv,  ".tga"sv,  ".hdr"sv,  ".pfm"sv, ".raw"sv, ".bin"sv, ".dng"sv, ".npz"sv,
                                  ".mat"sv,  ".mp4"sv,  ".mov"sv,  ".avi"sv, ".mkv"sv, ".dat"sv};
constexpr std::array kDepth{".npy"sv, ".exr"sv, ".tiff"sv, ".tif"sv, ".png"sv, ".pgm"sv};  // most precise first
constexpr std::size_t kMaxNear = 1000;  // images at the time of an image; more than any camera takes
constexpr double kMinStep = 1e-3;       // seconds between images with decimal seconds as names
constexpr double kMaxStep = 100;
// Steps between images, in clock units: 0.008 to 8 s, so that the units' ranges do not overlap.
constexpr std::uint64_t kMilliseconds = 8, kMicroseconds = 8'000, kNanoseconds = 8'000'000;
// A constant step up to this size counts frames, if the numbers are no times since 1970.
constexpr std::uint64_t kMaxStride = 1000, kEpoch = 100'000'000;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

std::string_view without_zeros(std::string_view digits) {
  return digits.substr(std::min(digits.find_first_not_of('0'), digits.size() - 1));
}

/// Removes and returns the leading digits.
std::string_view parse_digits(std::string_view& text) {
  std::size_t end = 0;
  while (end < text.size() && is_digit(text[end])) ++end;
  const auto digits = text.substr(0, end);
  text.remove_prefix(end);
  return digits;
}

/// Run of digits in a file name's stem.
struct Run {
  std::string_view digits;
  std::size_t at;
};
std::vector<Run> runs_of(std::string_view stem) {
  std::vector<Run> runs;
  for (std::size_t at = 0; at < stem.size(); ++at) {
    if (!is_digit(stem[at])) continue;
    std::string_view rest = stem.substr(at);
    runs.push_back({parse_digits(rest), at});
    at += runs.back().digits.size();
  }
  return runs;
}

std::vector<std::uint64_t> sorted(std::vector<std::uint64_t> values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
  return values;
}

template <class T>
std::vector<T> steps_of(const std::vector<T>& values) {
  std::vector<T> steps(values.size());
  std::adjacent_difference(values.begin(), values.end(), steps.begin());
  if (!steps.empty()) steps.erase(steps.begin());
  return steps;
}
double median_step(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return median(steps_of(values));
}

/// Unit of integer names, from their values and steps.
Numbering::Unit unit_of(const std::vector<std::uint64_t>& numbers, bool padded) {
  using Unit = Numbering::Unit;
  const auto steps = steps_of(sorted(numbers));
  const std::uint64_t first = *std::min_element(numbers.begin(), numbers.end()), step = median(steps);
  const bool since_1970 = first >= kEpoch;
  if (steps.empty() && !since_1970) return Unit::frames;
  if (steps.empty())
    return first < 100 * kEpoch           ? Unit::seconds
           : first < 100'000 * kEpoch     ? Unit::milliseconds
           : first < 100'000'000 * kEpoch ? Unit::microseconds
                                          : Unit::nanoseconds;
  const bool is_regular = std::all_of(steps.begin(), steps.end(), [&](std::uint64_t s) { return s % step == 0; });
  if (!since_1970 && (step < kMilliseconds || padded || (is_regular && step < kMaxStride))) return Unit::frames;
  if (step < kMilliseconds) return Unit::seconds;
  return step < kMicroseconds ? Unit::milliseconds : step < kNanoseconds ? Unit::microseconds : Unit::nanoseconds;
}

double seconds_in(Numbering::Unit unit) {
  switch (unit) {
    case Numbering::Unit::milliseconds:
      return 1e-3;
    case Numbering::Unit::microseconds:
      return 1e-6;
    case Numbering::Unit::nanoseconds:
      return 1e-9;
    default:
      return 1;
  }
}

/// Parses decimal seconds at a run, for example 1305031102.175304. Returns false if the names have none.
bool parse_seconds(const std::vector<std::vector<Run>>& runs, std::span<const std::string> stems, std::size_t at,
                   Numbering& found) {
  std::vector<double> values;
  for (std::size_t i = 0; i < stems.size(); ++i) {
    const Run &integer = runs[i][at], &fraction = runs[i][at + 1];
    if (fraction.at != integer.at + integer.digits.size() + 1 || stems[i][fraction.at - 1] != '.') return false;
    const auto value =
        number_in(std::string_view(stems[i]).substr(integer.at, fraction.at + fraction.digits.size() - integer.at));
    if (!value || *value > 1e12) return false;
    values.push_back(*value);
  }
  const double step = median_step(values);
  if (values.size() > 1 && !(step >= kMinStep && step <= kMaxStep)) return false;
  found.unit = Numbering::Unit::seconds;
  found.values = std::move(values);
  return true;
}

void parse_numbers(const std::vector<std::vector<Run>>& runs, std::size_t at, Numbering& found) {
  std::vector<std::uint64_t> numbers;
  bool padded = false;
  for (const auto& of_image : runs) {
    const auto number = number_in<std::uint64_t>(of_image[at].digits);
    if (!number) return;
    numbers.push_back(*number);
    padded |= of_image[at].digits.size() > 1 && of_image[at].digits[0] == '0';
  }
  found.unit = unit_of(numbers, padded);
  const bool is_time = found.is_time();
  // Nanoseconds since 1970 exceed the precision of a double; times relative to the first second do not.
  const auto per_second = is_time ? static_cast<std::uint64_t>(std::llround(1 / seconds_in(found.unit))) : 1;
  found.values.reserve(found.values.size() + numbers.size());
  for (const std::uint64_t number : numbers) {
    const std::uint64_t integer = number / per_second;
    found.values.push_back(static_cast<double>(integer) +
                           static_cast<double>(number - integer * per_second) / static_cast<double>(per_second));
  }
}

/// Maps each key to its image; duplicate keys map to -1.
template <class Key>
std::map<Key, int> index_of(const std::vector<Key>& keys) {
  std::map<Key, int> indices;
  for (std::size_t i = 0; i < keys.size(); ++i)
    if (const auto [it, is_new] = indices.emplace(keys[i], static_cast<int>(i)); !is_new) it->second = -1;
  return indices;
}

template <class Key>
std::vector<int> equal_keys(const std::vector<Key>& depth, const std::vector<Key>& color) {
  const auto own = index_of(depth), others = index_of(color);
  std::vector<int> match(depth.size(), -1);
  for (std::size_t i = 0; i < depth.size(); ++i)
    if (const auto it = others.find(depth[i]); it != others.end() && own.at(depth[i]) >= 0) match[i] = it->second;
  return match;
}

std::vector<std::string> stems_of(std::span<const fs::path> images) {
  std::vector<std::string> stems;
  for (const auto& image : images) stems.push_back(lower(image.stem().string()));
  return stems;
}

/// All numbers of each name, for sets of a single image, where no number differs.
std::vector<std::vector<std::string>> all_numbers(std::span<const fs::path> images) {
  std::vector<std::vector<std::string>> keys;
  for (const auto& stem : stems_of(images)) {
    auto& key = keys.emplace_back();
    for (const Run& run : runs_of(stem)) key.emplace_back(without_zeros(run.digits));
  }
  return keys;
}

int count(const std::vector<int>& match) {
  return static_cast<int>(std::count_if(match.begin(), match.end(), [](int c) { return c >= 0; }));
}

}  // namespace

bool natural_less(std::string_view a, std::string_view b) {
  const std::string_view full_a = a, full_b = b;
  while (!a.empty() && !b.empty()) {
    if (is_digit(a[0]) && is_digit(b[0])) {
      const auto left = without_zeros(parse_digits(a)), right = without_zeros(parse_digits(b));
      if (left.size() != right.size()) return left.size() < right.size();
      if (left != right) return left < right;
    } else {
      if (a[0] != b[0]) return a[0] < b[0];
      a.remove_prefix(1), b.remove_prefix(1);
    }
  }
  if (a.empty() != b.empty()) return a.empty();
  return full_a < full_b;  // for example 1 and 01
}

std::string lower(std::string text) {
  for (char& c : text)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return text;
}

std::vector<fs::path> files_in(const fs::path& folder, std::span<const std::string_view> extensions) {
  std::vector<fs::path> files;
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) return files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string extension = extension_of(entry.path());
    if (entry.path().filename().string().starts_with('.') || entry.is_directory(ignored)) continue;
    if (std::find(extensions.begin(), extensions.end(), extension) != extensions.end()) files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end(), [](const fs::path& a, const fs::path& b) {
    return natural_less(a.filename().string(), b.filename().string());
  });
  return files;
}

namespace {

/// Keeps, of several files with the same stem, the file with the preferred extension.
template <class Extensions>
std::vector<fs::path> preferred_in(const fs::path& folder, const Extensions& extensions) {
  auto files = files_in(folder, extensions);
  const auto rank = [&](const fs::path& file) {
    return std::find(extensions.begin(), extensions.end(), extension_of(file)) - extensions.begin();
  };
  std::map<std::string, fs::path> best;
  for (const auto& file : files)
    if (const auto [it, is_new] = best.emplace(file.stem().string(), file); !is_new && rank(file) < rank(it->second))
      it->second = file;
  std::erase_if(files, [&](const fs::path& file) { return best.at(file.stem().string()) != file; });
  return files;
}

}  // namespace

std::vector<fs::path> images_in(const fs::path& folder) { return preferred_in(folder, kColor); }

std::vector<fs::path> depth_images_in(const fs::path& folder) { return preferred_in(folder, kDepth); }

std::optional<std::string> skipped_files_in(const fs::path& folder, std::span<const fs::path> taken) {
  std::map<std::string, int> kinds;
  for (const auto& file : files_in(folder, kUnsupported))
    if (std::find(taken.begin(), taken.end(), file) == taken.end()) ++kinds[extension_of(file)];
  const auto most =
      std::max_element(kinds.begin(), kinds.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  if (most == kinds.end()) return std::nullopt;
  return fmt::format("{} {} {} in {} {} not read", most->second, most->second == 1 ? "file" : "files", most->first,
                     folder.filename().string(), most->second == 1 ? "is" : "are");
}

Numbering numbering_of(std::span<const fs::path> images) {
  Numbering found;
  const auto stems = stems_of(images);
  std::vector<std::vector<Run>> runs;
  runs.reserve(stems.size());
  for (const auto& stem : stems) runs.push_back(runs_of(stem));
  if (runs.empty() || runs[0].empty()) return found;
  for (const auto& of_image : runs)
    if (of_image.size() != runs[0].size()) return found;
  std::vector<std::size_t> differing;
  for (std::size_t at = 0; at < runs[0].size(); ++at)
    if (std::any_of(runs.begin(), runs.end(),
                    [&](const auto& r) { return without_zeros(r[at].digits) != without_zeros(runs[0][at].digits); }))
      differing.push_back(at);
  for (const auto& of_image : runs) {
    auto& key = found.keys.emplace_back();
    for (const std::size_t at : differing) key.emplace_back(without_zeros(of_image[at].digits));
  }
  const bool is_single = images.size() == 1;
  if (is_single) differing = {runs[0].size() - 1};
  if (differing.empty()) return found;
  const std::size_t last = differing.back();
  const bool may_be_seconds = differing.size() == 1 || (differing.size() == 2 && differing[0] + 1 == last);
  const bool are_seconds =
      may_be_seconds &&
      ((last > 0 && parse_seconds(runs, stems, last - 1, found)) ||
       (differing.size() == 1 && last + 1 < runs[0].size() && parse_seconds(runs, stems, last, found)));
  if (!are_seconds && differing.size() == 1) parse_numbers(runs, last, found);
  found.step = median_step(found.values);
  return found;
}

const char* to_string(Numbering::Unit unit) {
  constexpr const char* kNames[] = {"none", "frames", "seconds", "milliseconds", "microseconds", "nanoseconds"};
  return kNames[static_cast<int>(unit)];
}

const char* to_string(Pairs::By by) {
  constexpr const char* kNames[] = {"nothing", "equal names", "equal numbers", "near times", "order"};
  return kNames[static_cast<int>(by)];
}

std::vector<int> associate(std::span<const double> times, std::span<const double> others, double max_difference) {
  std::vector<int> order(others.size());
  std::iota(order.begin(), order.end(), 0);
  const auto time = [&](int i) { return others[static_cast<std::size_t>(i)]; };
  std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return time(a) < time(b); });
  std::vector<std::tuple<double, int, int>> pairs;  // difference, index in times, index in others
  for (std::size_t i = 0; i < times.size(); ++i) {
    auto it = std::lower_bound(order.begin(), order.end(), times[i] - max_difference,
                               [&](int k, double t) { return time(k) < t; });
    const std::size_t first = pairs.size();
    for (; it != order.end() && time(*it) <= times[i] + max_difference; ++it) {
      if (pairs.size() - first == kMaxNear)
        throw std::runtime_error(
            fmt::format("more than {} images are within {:.3g} s of each other", kMaxNear, 2 * max_difference));
      pairs.emplace_back(std::abs(time(*it) - times[i]), static_cast<int>(i), *it);
    }
  }
  std::sort(pairs.begin(), pairs.end());
  std::vector<int> match(times.size(), -1);
  std::vector<bool> taken(others.size(), false);
  for (const auto& [difference, i, k] : pairs) {
    if (match[static_cast<std::size_t>(i)] >= 0 || taken[static_cast<std::size_t>(k)]) continue;
    match[static_cast<std::size_t>(i)] = k;
    taken[static_cast<std::size_t>(k)] = true;
  }
  return match;
}

std::optional<Pairs> pair_images(std::span<const fs::path> depth, const Numbering& depth_names,
                                 std::span<const fs::path> color, const Numbering& color_names) {
  Pairs best{.color = std::vector<int>(depth.size(), -1)};
  int most = 0;
  const auto take = [&](Pairs::By by, std::vector<int> match) {
    if (count(match) > most) best.by = by, most = count(match), best.color = std::move(match);
  };
  take(Pairs::By::name, equal_keys(stems_of(depth), stems_of(color)));
  if (depth.size() > 1 && color.size() > 1)
    take(Pairs::By::number, equal_keys(depth_names.keys, color_names.keys));
  else
    take(Pairs::By::number, equal_keys(all_numbers(depth), all_numbers(color)));
  if (depth_names.is_time() && color_names.is_time() && depth.size() > 1 && color.size() > 1)
    take(Pairs::By::time,
         associate(depth_names.values, color_names.values, 0.5 * std::min(depth_names.step, color_names.step)));
  if (most == 0 && depth.size() == color.size()) {
    best.by = Pairs::By::order;
    most = static_cast<int>(depth.size());
    std::iota(best.color.begin(), best.color.end(), 0);
  }
  if (most == 0 && !color.empty()) return std::nullopt;
  best.alone = static_cast<int>(depth.size()) - most;
  best.color_alone = static_cast<int>(color.size()) - most;
  return best;
}

}  // namespace cairn
