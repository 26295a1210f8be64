// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/spool.hpp"

#include <stdexcept>
#include <vector>

#include "base/system_file.hpp"

namespace cairn {
namespace {

constexpr std::size_t kAtOnce = std::size_t{1} << 20;  // bytes

std::runtime_error not_written(const std::filesystem::path& file, const SystemError& error) {
  return std::runtime_error("cannot write " + file.string() + ": " + reason(error.number));
}

std::unique_ptr<SystemFile> nameless(const std::filesystem::path& file) {
  const std::filesystem::path temporary = temporary_beside(file);
  auto made = begin_temporary(temporary);
  unlink(temporary.c_str());
  return made;
}

}  // namespace

struct Spool::State {
  std::filesystem::path beside;
  std::unique_ptr<SystemFile> file;
};

Spool::Spool(const std::filesystem::path& file) {
  try {
    state_ = std::make_unique<State>(State{file, nameless(file)});
  } catch (const SystemError& error) {
    throw not_written(file, error);
  }
}
Spool::~Spool() = default;
Spool::Spool(Spool&&) noexcept = default;

void Spool::append(std::string_view bytes) {
  try {
    state_->file->write(bytes.data(), bytes.size());
  } catch (const SystemError& error) {
    throw not_written(state_->beside, error);
  }
}

void Spool::copy_to(std::ostream& out) const {
  std::vector<char> bytes(kAtOnce);
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

}  // namespace cairn
