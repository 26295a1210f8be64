// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/spool.hpp"

#include <sys/mman.h>
#include <sys/stat.h>

#include <stdexcept>
#include <vector>

#include "base/system_file.hpp"

namespace cairn {
namespace {

constexpr std::size_t kCopySize = std::size_t{1} << 20;  // bytes

std::runtime_error write_error(const std::filesystem::path& file, const SystemError& error) {
  return std::runtime_error("cannot write " + file.string() + ": " + reason(error.number));
}

std::unique_ptr<SystemFile> unnamed_file(const std::filesystem::path& file) {
  TemporaryFile temporary = make_temporary(file);
  unlink(temporary.path.c_str());
  return std::move(temporary.file);
}

}  // namespace

struct Spool::State {
  State(std::filesystem::path named_after, std::unique_ptr<SystemFile> temporary)
      : name(std::move(named_after)), file(std::move(temporary)) {}
  ~State() { unmap(); }
  State(const State&) = delete;
  State& operator=(const State&) = delete;
  void unmap() {
    if (pages != nullptr) munmap(pages, mapped);
    pages = nullptr;
  }
  std::filesystem::path name;
  std::unique_ptr<SystemFile> file;
  void* pages = nullptr;
  std::size_t mapped = 0;  // bytes
};

Spool::Spool(const std::filesystem::path& file) {
  try {
    state_ = std::make_unique<State>(file, unnamed_file(file));
  } catch (const SystemError& error) {
    throw write_error(file, error);
  }
}
Spool::~Spool() = default;
Spool::Spool(Spool&&) noexcept = default;

void Spool::append(std::string_view bytes) {
  try {
    state_->file->write(bytes.data(), bytes.size());
  } catch (const SystemError& error) {
    throw write_error(state_->name, error);
  }
}

void Spool::copy_to(std::ostream& out) const {
  std::vector<char> bytes(kCopySize);
  off_t at = 0;
  while (true) {
    const ssize_t count = pread(state_->file->descriptor(), bytes.data(), bytes.size(), at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) throw std::runtime_error(reason(errno));
    if (count == 0) return;
    out.write(bytes.data(), count);
    at += count;
  }
}

std::string_view Spool::mapped() {
  state_->unmap();
  struct stat now {};
  if (fstat(state_->file->descriptor(), &now) != 0) throw std::runtime_error(reason(errno));
  if (now.st_size == 0) return {};
  const auto size = static_cast<std::size_t>(now.st_size);
  void* const pages = mmap(nullptr, size, PROT_READ, MAP_SHARED, state_->file->descriptor(), 0);
  if (pages == MAP_FAILED) throw std::runtime_error(reason(errno));
  state_->pages = pages, state_->mapped = size;
  return {static_cast<const char*>(pages), size};
}

}  // namespace cairn
