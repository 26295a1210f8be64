// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/zips.hpp"

#include <sys/stat.h>
#include <zip.h>

#include <stdexcept>

namespace cairn {

void write_zip(const std::filesystem::path& archive, const std::vector<ZipEntry>& entries) {
  zip_t* zip = zip_open(archive.c_str(), ZIP_CREATE | ZIP_TRUNCATE, nullptr);
  if (zip == nullptr) throw std::runtime_error(archive.string() + ": cannot be written");
  for (const ZipEntry& entry : entries) {
    if (entry.name.ends_with('/')) {
      zip_dir_add(zip, entry.name.c_str(), 0);
      continue;
    }
    zip_source_t* source = zip_source_buffer(zip, entry.bytes.data(), entry.bytes.size(), 0);
    const auto at = static_cast<zip_uint64_t>(zip_file_add(zip, entry.name.c_str(), source, 0));
    if (entry.stored) zip_set_file_compression(zip, at, ZIP_CM_STORE, 0);
    if (entry.link) zip_file_set_external_attributes(zip, at, 0, ZIP_OPSYS_UNIX, (S_IFLNK | 0777u) << 16);
    if (!entry.password.empty()) zip_file_set_encryption(zip, at, ZIP_EM_AES_256, entry.password.c_str());
  }
  if (zip_close(zip) != 0) throw std::runtime_error(archive.string() + ": " + zip_strerror(zip));
}

}  // namespace cairn
