// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/datasets/zip_recording.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <zip.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <optional>
#include <set>
#include <vector>

#include "base/atomic_file.hpp"
#include "base/file_name.hpp"
#include "base/words.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPrefix = "cairn-unpacked-";
constexpr const char* kMarker = ".cairn-unpacked";  // marker file; other folders with this prefix are never deleted
constexpr std::string_view kMarkerText = "A .zip file that cairn unpacks here while it reads it, and removes.\n";
constexpr std::uintmax_t kReserve = 64u << 20;  // bytes kept free on the disk
constexpr std::uintmax_t kFreeSize = 1u << 30;  // bytes; archives of any size may unpack to this much
constexpr std::uintmax_t kMaxRatio = 200;  // maximum compression ratio above kFreeSize; depth without noise reaches 50
constexpr std::size_t kBufferSize = 1u << 20;   // bytes
constexpr zip_int64_t kMaxEntries = 1'000'000;  // files and folders: nine hours of depth, color and confidence
constexpr std::size_t kMaxNameLength = 255,
                      kMaxPathLength = 2048;       // bytes, of a file name and of a path in the archive
constexpr auto kMinAge = std::chrono::minutes(1);  // a younger folder may not be locked yet

fs::path unpack_parent() {
  const fs::path preferred = "/var/tmp";
  std::error_code ignored;
  return std::getenv("TMPDIR") == nullptr && fs::is_directory(preferred, ignored) ? preferred
                                                                                  : fs::temp_directory_path();
}

bool has_marker(const fs::path& folder) {
  std::error_code ignored;
  if (fs::symlink_status(folder, ignored).type() != fs::file_type::directory) return false;
  std::ifstream in(folder / kMarker, std::ios::binary);
  std::string text(kMarkerText.size() + 1, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text == kMarkerText;
}

void remove_leftovers_in(const fs::path& path) {
  std::error_code error;
  for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
    if (!it->path().filename().string().starts_with(kPrefix)) continue;
    std::error_code ignored;
    const auto written = fs::last_write_time(it->path(), ignored);
    if (ignored || fs::file_time_type::clock::now() - written < kMinAge) continue;
    if (!has_marker(it->path())) continue;
    try {
      if (const auto lock = FileLock::take(it->path(), FileLock::Kind::exclusive)) fs::remove_all(it->path(), ignored);
    } catch (const std::runtime_error&) {
      // The folder belongs to another user.
    }
  }
}

fs::path make_folder() {
  const fs::path path = unpack_parent();
  remove_leftovers_in(path);
  std::string name = (path / kPrefix).string() + "XXXXXX";
  if (mkdtemp(name.data()) == nullptr)
    throw std::runtime_error(fmt::format(
        "{}: cannot create a folder there to unpack a .zip file; set TMPDIR to another folder", path.string()));
  return name;
}

/// Locks and marks the folder: marked folders without a lock are leftovers.
FileLock lock_of(const fs::path& folder) {
  if (auto lock = FileLock::take(folder, FileLock::Kind::exclusive)) {
    write_whole(folder / kMarker, kMarkerText, Durable::some_time);
    return *std::move(lock);
  }
  throw std::runtime_error(folder.string() + ": is locked by another program");
}

/// Folder name for an archive's content: the archive's stem, unless it is empty or starts with a dot, as for "...zip".
fs::path to_string(const fs::path& archive) {
  const fs::path name = archive.stem();
  return name.empty() || name.string().starts_with('.') ? fs::path("recording") : name;
}

/// File or folder of an archive.
struct Entry {
  zip_uint64_t number = 0;
  fs::path path;  // relative path in the archive
  bool is_folder = false;
  std::uintmax_t size = 0;  // bytes, uncompressed
};

/// Open archive; errors do not contain its name.
class Archive {
 public:
  explicit Archive(const fs::path& file) {
    int code = 0;
    zip_ = zip_open(file.c_str(), ZIP_RDONLY, &code);
    if (zip_ == nullptr && code == ZIP_ER_OPEN) throw std::runtime_error("cannot be read; check its permissions");
    if (zip_ == nullptr) throw std::runtime_error("is cut off or not a .zip file; copy it again");
  }
  ~Archive() { zip_discard(zip_); }
  Archive(const Archive&) = delete;
  Archive& operator=(const Archive&) = delete;

  [[nodiscard]] std::vector<Entry> entries() const {
    std::vector<Entry> all;
    const zip_int64_t count = zip_get_num_entries(zip_, 0);
    if (count > kMaxEntries)
      throw std::runtime_error(
          fmt::format("has {} files, more than {}; unpack it yourself if it is a recording", count, kMaxEntries));
    std::set<fs::path> paths;
    for (zip_int64_t i = 0; i < count; ++i)
      if (auto entry = this->entry(static_cast<zip_uint64_t>(i))) {
        if (!entry->is_folder && !paths.insert(entry->path).second)
          throw std::runtime_error(
              fmt::format("has '{}' twice; pack the recording's folder again", shown(entry->path.string())));
        all.push_back(*std::move(entry));
      }
    return all;
  }

  /// Unpacks an entry; returns the error in its bytes, if any. Throws on a write error.
  [[nodiscard]] std::optional<std::string> unpack(const Entry& entry, const fs::path& file) {
    std::ofstream out(file, std::ios::binary);
    zip_file_t* in = zip_fopen_index(zip_, entry.number, 0);
    if (in == nullptr) return zip_strerror(zip_);
    const std::unique_ptr<zip_file_t, int (*)(zip_file_t*)> closed(in, zip_fclose);
    for (std::uintmax_t left = entry.size;;) {
      const zip_int64_t read = zip_fread(in, buffer_.data(), buffer_.size());
      if (read < 0) return zip_file_strerror(in);
      if (static_cast<std::uintmax_t>(read) > left) return "is larger than the archive states";
      left -= static_cast<std::uintmax_t>(read);
      out.write(buffer_.data(), read);
      if (read > 0) continue;
      if (!out.flush())
        throw std::runtime_error(fmt::format("'{}' in it cannot be written to {}; free disk space there, or set TMPDIR",
                                             shown(entry.path.string()), file.parent_path().string()));
      return left > 0 ? std::optional<std::string>("is cut off") : std::nullopt;
    }
  }

 private:
  /// Returns an entry; empty for files added by operating systems.
  [[nodiscard]] std::optional<Entry> entry(zip_uint64_t number) const {
    zip_stat_t info;
    if (zip_stat_index(zip_, number, 0, &info) != 0 || (info.valid & ZIP_STAT_NAME) == 0)
      throw std::runtime_error(fmt::format("its entry {} is damaged; copy it again", number));
    std::string name = info.name;
    std::replace(name.begin(), name.end(), '\\', '/');  // separators of Windows programs
    const auto reject = [&](const char* why) {
      throw std::runtime_error(fmt::format("has '{}', which {}", shown(name), why));
    };
    Entry entry{.number = number, .path = fs::path(name).lexically_normal(), .is_folder = name.ends_with('/')};
    if (name.empty() || name.starts_with('/')) reject("is not a relative path; pack the recording's folder again");
    if (name.size() > kMaxPathLength) reject("has too long a name; pack the recording's folder again");
    for (const fs::path& component : fs::path(name)) {
      if (component.string().size() > kMaxNameLength) reject("has too long a name; pack the recording's folder again");
      if (component == "..") reject("leads outside its folder; pack the recording's folder again");
      if (component == "__MACOSX" || (component != "." && component.string().starts_with('.'))) return std::nullopt;
    }
    if ((info.valid & ZIP_STAT_ENCRYPTION_METHOD) != 0 && info.encryption_method != ZIP_EM_NONE)
      reject("is encrypted; unpack the archive with its password, and give the folder");
    zip_uint8_t system = 0;
    zip_uint32_t attributes = 0;
    if (zip_file_get_external_attributes(zip_, number, 0, &system, &attributes) == 0 && system == ZIP_OPSYS_UNIX &&
        S_ISLNK(attributes >> 16))
      reject("is a link; pack the folder with the files themselves");
    if (!entry.is_folder && zip_compression_method_supported(info.comp_method, 0) == 0)
      reject("is compressed by an unknown method; pack the folder with `zip -r`");
    entry.size = entry.is_folder ? 0 : info.size;
    return entry;
  }

  zip_t* zip_ = nullptr;
  std::vector<char> buffer_ = std::vector<char>(kBufferSize);
};

void check_space(const std::vector<Entry>& entries, const fs::path& archive, const fs::path& folder) {
  std::uintmax_t size = 0;
  for (const Entry& entry : entries) {
    if (entry.size > UINTMAX_MAX - size) throw std::runtime_error("has impossible sizes; copy it again");
    size += entry.size;
  }
  if (size > kFreeSize && size / kMaxRatio > fs::file_size(archive))
    throw std::runtime_error(
        fmt::format("would unpack to {} MiB, more than {} times its size; unpack it yourself if it is a recording",
                    size >> 20, kMaxRatio));
  const std::uintmax_t available = fs::space(folder).available;
  if (available < kReserve || size > available - kReserve)
    throw std::runtime_error(fmt::format(
        "unpacks to {} MiB, but {} has {} MiB free; free disk space there, or set TMPDIR to a folder on another disk",
        size >> 20, folder.parent_path().string(), available >> 20));
}

}  // namespace

bool is_zip(const std::string& name) {
  std::error_code ignored;
  return extension_of(name) == ".zip" && !fs::is_directory(name, ignored);
}

UnpackedZip::UnpackedZip(const fs::path& archive)
    : archive_(archive),
      folder_(make_folder()),
      unfinished_(folder_),
      lock_(lock_of(folder_)),
      content_(folder_ / to_string(archive)) {
  try {
    unpack();
  } catch (...) {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
    throw;
  }
}

void UnpackedZip::unpack() {
  try {
    if (!fs::exists(archive_)) throw std::runtime_error("there is no such file");
    if (!fs::is_regular_file(archive_)) throw std::runtime_error("is not a file");
    if (fs::file_size(archive_) == 0) throw std::runtime_error("is empty; copy it again");
    Archive archive(archive_);
    const auto entries = archive.entries();
    check_space(entries, archive_, folder_);
    std::size_t files = 0, damaged = 0;
    std::string first;
    for (const Entry& entry : entries) {
      const fs::path path = content_ / entry.path;
      fs::create_directories(entry.is_folder ? path : path.parent_path());
      if (entry.is_folder) continue;
      ++files;
      if (const auto error = archive.unpack(entry, path); error && damaged++ == 0)
        first = fmt::format("'{}': {}", shown(entry.path.string()), *error);
    }
    if (files == 0) throw std::runtime_error("has no files; pack the recording's folder again");
    if (damaged > 0)
      damage_ = fmt::format("{}: {} of {} files in it are damaged, the first is {}; copy it again", archive_.string(),
                            damaged, files, first);
  } catch (const fs::filesystem_error& error) {
    throw std::runtime_error(
        fmt::format("{}: cannot be unpacked: {}", archive_.string(), shown(error.code().message())));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}", archive_.string(), error.what()));
  }
}

UnpackedZip::~UnpackedZip() {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

std::string UnpackedZip::recording() const {
  fs::path at = content_;
  for (;;) {
    std::vector<fs::directory_entry> inside;
    for (const auto& entry : fs::directory_iterator(at)) {
      inside.push_back(entry);
      if (inside.size() > 1) return at;
    }
    if (inside.size() != 1 || is_zip(inside[0].path())) return at;
    at = inside[0].path();
    if (!inside[0].is_directory()) return at;
  }
}

std::string UnpackedZip::by_archive_name(std::string text) const {
  const std::string here = content_.string(), named = archive_.string();
  for (std::size_t at = 0; (at = text.find(here, at)) != text.npos; at += named.size())
    text.replace(at, here.size(), named);
  return text;
}

std::shared_ptr<const UnpackedZip> unpacked(const fs::path& archive) {
  using Key = std::tuple<fs::path, std::uintmax_t, fs::file_time_type>;
  static std::mutex mutex;
  static std::pair<Key, std::shared_ptr<const UnpackedZip>> last;
  const std::lock_guard lock(mutex);
  std::error_code ignored;
  const Key key{fs::weakly_canonical(archive, ignored), fs::file_size(archive, ignored),
                fs::last_write_time(archive, ignored)};
  if (last.second && last.first == key) return last.second;
  last.second.reset();
  last = {key, std::make_shared<UnpackedZip>(archive)};
  return last.second;
}

}  // namespace cairn
