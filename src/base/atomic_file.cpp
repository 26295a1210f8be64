// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "cairn/atomic_file.hpp"

#include <sys/file.h>

#include <memory>
#include <stdexcept>
#include <streambuf>
#include <string>
#include <vector>

#include "base/system_file.hpp"
#include "cairn/unfinished.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kBuffer = std::size_t{1} << 20;  // bytes between two writes of a stream

void sync(const fs::path& folder) {
  try {
    SystemFile(folder.empty() ? fs::path(".") : folder, O_RDONLY | O_DIRECTORY).sync();
  } catch (const SystemError& error) {
    if (error.number != EINVAL && error.number != ENOTSUP) throw;  // of a file system whose folders need none
  }
}

/// A stream's way into a file: few large writes, and the first error is kept, since streams do not tell it.
class FileBuffer final : public std::streambuf {
 public:
  explicit FileBuffer(const SystemFile& file) : file_(file), bytes_(kBuffer) { start(); }
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
  const fs::path temporary = temporary_beside(file);
  const Unfinished unfinished(temporary);
  bool exists = false;
  try {
    const auto out = begin_temporary(temporary);
    exists = true;
    write(*out);
    if (durable == Durable::now) out->sync();
    if (std::rename(temporary.c_str(), file.c_str()) != 0) throw SystemError{errno};
    exists = false;
    out->close();
    if (durable == Durable::now) sync(file.parent_path());
  } catch (const SystemError& error) {
    if (exists) unlink(temporary.c_str());
    throw std::runtime_error("cannot write " + file.string() + ": " + reason(error.number));
  } catch (const std::exception& error) {
    if (exists) unlink(temporary.c_str());
    throw std::runtime_error("cannot write " + file.string() + ": " + error.what());
  }
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
      if (buffer.error() == 0) throw;  // else this is only what followed from it
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
  if (fs::exists(folder) && !(fs::is_directory(folder) && fs::is_empty(folder)) &&
      (mark == nullptr || !fs::exists(folder / mark)))
    throw std::runtime_error(folder.string() + ": exists and holds something else; choose another folder");
  fs::path whole = fs::weakly_canonical(fs::absolute(folder));
  if (!whole.has_filename()) whole = whole.parent_path();
  fs::path part = whole;
  part += ".part";
  const auto must = [&](const std::error_code& error) {
    if (error) throw std::runtime_error("cannot write " + folder.string() + ": " + reason(error.value()));
  };
  std::error_code error, ignored;
  fs::remove_all(part, error);
  if (!error) fs::create_directories(part, error);
  must(error);
  const Unfinished unfinished(part);
  try {
    write(part);
    fs::remove_all(whole, error);
    if (!error) fs::rename(part, whole, error);
    must(error);
  } catch (...) {
    fs::remove_all(part, ignored);
    throw;
  }
}

void remove_leftovers(const fs::path& folder) {
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(kTemporary) || !entry.is_regular_file(error)) continue;
    const std::size_t end = name.find_first_not_of("0123456789", kTemporary.size());
    if (end == kTemporary.size() || end == name.npos || name[end] != '.') continue;
    try {
      const SystemFile left(entry.path(), O_RDWR);
      if (flock(left.descriptor(), LOCK_EX | LOCK_NB) == 0) unlink(entry.path().c_str());
    } catch (const SystemError&) {
      // Somebody else's: it stays.
    }
  }
}

void sync_folder(const fs::path& folder) {
  try {
    sync(folder);
  } catch (const SystemError& error) {
    throw std::runtime_error("cannot write " + folder.string() + ": " + reason(error.number));
  }
}

}  // namespace cairn
