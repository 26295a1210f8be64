// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cli/inputs_and_outputs.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <compare>
#include <functional>
#include <optional>
#include <stdexcept>

#include "cairn/building/project.hpp"
#include "cairn/io/source.hpp"
#include "cli/sources.hpp"

namespace cairn::apps {
namespace {

namespace fs = std::filesystem;

constexpr int kMaxDepth = 4;            // depth of the search below a recording's folder
constexpr int kMaxEntries = 1'000'000;  // limit on visited entries, since links may lead to a complete disk
constexpr int kMaxLinks = 40;           // limit of Linux

struct Identity {
  dev_t device = 0;
  ino_t inode = 0;
  auto operator<=>(const Identity&) const = default;
};

/// Identity of a path's target, following links; empty if it does not exist.
std::optional<Identity> identity_of(const fs::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return std::nullopt;
  return Identity{status.st_dev, status.st_ino};
}

/// Resolves links, also if the end of the path does not exist yet.
fs::path without_links(fs::path path) {
  for (int link = 0; link < kMaxLinks; ++link) {
    path = tidy(path);
    std::error_code error;
    const fs::path target = fs::read_symlink(path, error);  // for dangling links
    if (error) break;
    path = path.parent_path() / target;
  }
  return path;
}

/// Returns true if `visit` returns true for a parent folder, from the nearest to the root.
bool any_above(const fs::path& path, const std::function<bool(Identity)>& visit) {
  const fs::path resolved = without_links(path);
  for (fs::path folder = resolved.parent_path(), below = resolved; folder != below;
       below = folder, folder = folder.parent_path())
    if (const auto identity = identity_of(folder); identity && visit(*identity)) return true;
  return false;
}

using Visit = std::function<bool(const fs::directory_entry&)>;

bool any_below(const fs::path& folder, const Visit& visit, int depth, int& left) {
  std::error_code error, ignored;
  for (fs::directory_iterator it(folder, error), end; !error && it != end && left > 0; it.increment(error), --left) {
    if (visit(*it)) return true;
    if (depth > 0 && it->is_directory(ignored) && any_below(it->path(), visit, depth - 1, left)) return true;
  }
  return false;
}

/// Returns true if `visit` returns true for an entry of the folder or of its subfolders down to kMaxDepth; follows
/// links.
bool any_below(const fs::path& folder, const Visit& visit) {
  int left = kMaxEntries;
  return any_below(folder, visit, kMaxDepth, left);
}

bool is_inside(const fs::path& output, const fs::path& input) {
  std::vector<Identity> above;
  (void)any_above(output, [&](Identity identity) {
    above.push_back(identity);
    return false;
  });
  const auto is_above = [&](const fs::path& folder) {
    const auto identity = identity_of(folder);
    return identity && std::find(above.begin(), above.end(), *identity) != above.end();
  };
  std::error_code ignored;
  if (!fs::is_directory(input, ignored)) return false;
  if (is_above(input)) return true;
  const auto output_identity = identity_of(output);
  return any_below(input, [&](const fs::directory_entry& entry) {
    std::error_code none;
    if (entry.is_directory(none) && is_above(entry.path())) return true;
    return output_identity && identity_of(entry.path()) == output_identity;
  });
}

bool contains_input(const fs::path& output, const fs::path& input) {
  const auto output_identity = identity_of(output);
  if (!output_identity) return false;
  const auto is_output = [&](Identity identity) { return identity == *output_identity; };
  if (any_above(input, is_output)) return true;
  return any_below(input, [&](const fs::directory_entry& entry) {
    std::error_code none;
    return entry.is_symlink(none) && entry.is_directory(none) && any_above(entry.path(), is_output);
  });
}

/// Recording of a project's segment. Empty for other inputs and for a damaged segment, which is reported when opened.
std::string recording_of_segment(const std::string& sequence) {
  if (is_synthetic(sequence) || is_sensor(sequence) || !fs::exists(fs::path(sequence) / "part.json")) return {};
  const fs::path segment = tidy(sequence);
  try {
    const Project plan = read_plan(segment.parent_path().parent_path());
    const auto it = std::find_if(plan.segments.begin(), plan.segments.end(),
                                 [&](const auto& p) { return p.name == segment.filename().string(); });
    return it == plan.segments.end() ? std::string() : plan.recordings[it->recording].name;
  } catch (const std::runtime_error&) {
    return {};
  }
}

}  // namespace

Inputs& Inputs::add(const fs::path& path) {
  if (!path.empty() && identity_of(path)) inputs_.push_back({.path = path});
  return *this;
}

Inputs& Inputs::add_recording(const std::string& sequence) {
  if (is_synthetic(sequence) || is_sensor(sequence)) return *this;
  return add(sequence).add(recording_of_segment(sequence));
}

Inputs& Inputs::add_map(const fs::path& map) {
  std::error_code ignored;
  if (!fs::is_directory(map, ignored) || fs::exists(map / "state.cbor")) return add(map);
  inputs_.push_back({.path = map, .has_contents = false});
  if (fs::exists(map / "session" / "state.cbor"))
    add(map / "session");
  else
    add(map / "map.vdb");
  if (!fs::exists(map / "plan.json")) return *this;
  for (const char* name : {"plan.json", "parts", "cells", "loops"}) add(map / name);
  for (fs::directory_iterator it(map / "maps", ignored), end; !ignored && it != end; it.increment(ignored))
    add(it->path() / "session");
  return *this;
}

void Inputs::check_outside(const fs::path& output) const {
  const auto output_identity = identity_of(output);
  for (const Input& input : inputs_) {
    if (output_identity && identity_of(input.path) == output_identity)
      throw std::runtime_error(fmt::format("{}: is the input {}, which must not be changed; choose another output",
                                           output.string(), input.path.string()));
    if (input.has_contents && is_inside(output, input.path))
      throw std::runtime_error(fmt::format("{}: is inside the input {}; choose an output outside of it",
                                           output.string(), input.path.string()));
  }
}

void Inputs::check_output_file(const fs::path& output) const {
  if (!output.empty()) check_outside(output);
}

void Inputs::check_output_folder(const fs::path& output) const {
  check_outside(output);
  for (const Input& input : inputs_)
    if (contains_input(output, input.path))
      throw std::runtime_error(fmt::format("{}: contains the input {}; choose a separate folder for the output",
                                           output.string(), input.path.string()));
}

}  // namespace cairn::apps
