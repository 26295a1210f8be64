// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/runtime_library.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <filesystem>
#include <stdexcept>
#include <utility>

namespace cairn {

RuntimeLibrary::RuntimeLibrary(std::span<const std::string> files, LibraryErrors errors) : errors_(std::move(errors)) {
  std::string failure;  // of a library that exists
  for (const std::string& file : files) {
    library_ = dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (library_ != nullptr) return;
    const char* error = dlerror();
    if (failure.empty() && error != nullptr &&
        !std::string_view(error).starts_with(file + ": cannot open shared object"))
      failure = error;
  }
  if (!failure.empty()) throw std::runtime_error(fmt::format("{}, which cannot be loaded: {}", errors_.need, failure));
  throw std::runtime_error(
      fmt::format("{}, whose {} is not installed: {}", errors_.need, files.front(), errors_.install));
}

void* RuntimeLibrary::address_of(const char* name) const {
  void* address = dlsym(library_, name);
  if (address == nullptr)
    throw std::runtime_error(fmt::format("{}, and the installed version lacks {}{}", errors_.need, name,
                                         errors_.update.empty() ? "" : ": " + errors_.update));
  return address;
}

}  // namespace cairn
