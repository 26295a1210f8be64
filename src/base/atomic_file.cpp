// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/atomic_file.hpp"

#include <sys/file.h>
#include <sys/stat.h>

#include <memory>
#include <stdexcept>
#include <streambuf>
#include <string>
#include <vector>

#include "base/staging_folder.hpp"
#include "base/system_file.hpp"
#include "base/unfinished.hpp"
#include "base/writable_folder.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBufferSize = std::size_t{1} << 20;  // bytes per write of a stream

std::runtime_error write_error(const fs::path& path, const std::string& why) {
  return std::runtime_error("cannot write " + path.string() + ": " + why);
}

void sync(const fs::path& folder) {
  try {
    SystemFile(folder.empty() ? fs::path(".") : folder, O_RDONLY | O_DIRECTORY).sync();
  } catch (const SystemError& error) {
    if (error.number != EINVAL && error.number != ENOTSUP) throw;  // file systems without folder sync
  }
}

/// Stream buffer of a file: few large writes; keeps the first error, because streams do not report its cause.
class FileBuffer final : public std::streambuf {
 public:
  explicit FileBuffer(const SystemFile& file) : file_(file), bytes_(kBufferSize) { start(); }
  [[nodiscard]] int error() const { return error_; }

 protected:
  int sync() override {
    if (error_ == 0) try {
        file_.write(pbase(), static_cast<std::size_t>(pptr() - pbase()));
      } catch (const SystemError& error) {
        error_ = error.number;
      }
    start();
    return error_ == 0 ? 0 : -1;
  }
  int_type overflow(int_type c) override {
    if (sync() != 0) return traits_type::eof();
    return traits_type::eq_int_type(c, traits_type::eof()) ? traits_type::not_eof(c)
                                                           : sputc(traits_type::to_char_type(c));
  }
  pos_type seekoff(off_type offset, std::ios_base::seekdir from, std::ios_base::openmode) override {
    static constexpr int kFrom[] = {SEEK_SET, SEEK_CUR, SEEK_END};
    if (sync() != 0) return pos_type(off_type(-1));
    return lseek(file_.descriptor(), offset, kFrom[static_cast<int>(from)]);
  }
  pos_type seekpos(pos_type position, std::ios_base::openmode mode) override {
    return seekoff(off_type(position), std::ios_base::beg, mode);
  }

 private:
  void start() { setp(bytes_.data(), bytes_.data() + bytes_.size()); }
  const SystemFile& file_;
  std::vector<char> bytes_;
  int error_ = 0;
};

void write_temporary(const fs::path& file, Durable durable, const std::function<void(const SystemFile&)>& write) {
  fs::path temporary;  // set while the file exists
  try {
    TemporaryFile made = make_temporary(file);
    temporary = made.path;
    const Unfinished unfinished(temporary);
    write(*made.file);
    if (durable == Durable::now) made.file->sync();
    if (std::rename(temporary.c_str(), file.c_str()) != 0) throw SystemError{errno};
    temporary.clear();
    made.file->close();
    if (durable == Durable::now) sync(file.parent_path());
  } catch (const SystemError& error) {
    if (!temporary.empty()) unlink(temporary.c_str());
    throw write_error(file, reason(error.number));
  } catch (const std::exception& error) {
    if (!temporary.empty()) unlink(temporary.c_str());
    throw write_error(file, error.what());
  }
}

/// Throws if `folder` is not empty, unless it contains a file `mark`.
void expect_replaceable(const fs::path& folder, const char* mark) {
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder)) &&
      (mark == nullptr || !fs::exists(folder / mark)))
    throw std::runtime_error(folder.string() + ": exists and has other content; choose another folder");
}

}  // namespace

void write_whole(const fs::path& file, const std::function<void(std::ostream&)>& write) {
  write_temporary(file, Durable::now, [&](const SystemFile& to) {
    FileBuffer buffer(to);
    std::ostream out(&buffer);
    try {
      write(out);
      out.flush();
    } catch (...) {
      if (buffer.error() == 0) throw;  // otherwise a consequence of the write error
    }
    if (buffer.error() != 0) throw SystemError{buffer.error()};
  });
}

void write_whole(const fs::path& file, std::string_view text, Durable durable) {
  write_temporary(file, durable, [&](const SystemFile& to) { to.write(text.data(), text.size()); });
}

void write_whole(const fs::path& file, std::span<const std::uint8_t> bytes, Durable durable) {
  write_whole(file, std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()), durable);
}

void write_folder(const fs::path& folder, const std::function<void(const fs::path&)>& write, const char* mark) {
  expect_replaceable(folder, mark);
  fs::path absolute = fs::weakly_canonical(fs::absolute(folder));
  if (!absolute.has_filename()) absolute = absolute.parent_path();
  std::unique_ptr<StagingFolder> staging;
  try {
    std::error_code error;
    fs::create_directories(absolute.parent_path(), error);
    if (error) throw SystemError{error.value()};
    remove_leftovers(absolute.parent_path());
    staging = std::make_unique<StagingFolder>(absolute);
  } catch (const SystemError& error) {
    throw write_error(folder, reason(error.number));
  }
  write(staging->content());
  expect_replaceable(folder, mark);
  try {
    staging->replace_folder(absolute);
  } catch (const SystemError& error) {
    throw write_error(folder, reason(error.number));
  }
}

void expect_writable(const fs::path& folder) {
  try {
    unlink(make_temporary(folder / "try").path.c_str());
  } catch (const SystemError& error) {
    throw write_error(folder, reason(error.number));
  }
}

void remove_leftovers(const fs::path& folder) {
  std::error_code error;
  std::vector<fs::path> files, folders;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    if (!is_temporary(it->path().filename().string())) continue;
    std::error_code ignored;
    const fs::file_type type = it->symlink_status(ignored).type();
    if (type == fs::file_type::regular) files.push_back(it->path());
    if (type == fs::file_type::directory) folders.push_back(it->path());
  }
  for (const fs::path& file : files) try {
      const SystemFile left(file, O_RDWR | O_NOFOLLOW);
      struct stat now {};
      if (flock(left.descriptor(), LOCK_EX | LOCK_NB) == 0 && fstat(left.descriptor(), &now) == 0 && now.st_nlink > 0)
        unlink(file.c_str());
    } catch (const SystemError&) {
      // Of another user: keep it.
    }
  for (const fs::path& left : folders) remove_left_staging(left);
}

void sync_folder(const fs::path& folder) {
  try {
    sync(folder);
  } catch (const SystemError& error) {
    throw std::runtime_error("cannot write " + folder.string() + ": " + reason(error.number));
  }
}

}  // namespace cairn
