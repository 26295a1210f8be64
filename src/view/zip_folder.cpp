// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "view/zip_folder.hpp"

#include <zip.h>

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/file_name.hpp"

namespace cairn {

void zip_folder(const std::filesystem::path& folder, const std::filesystem::path& file) {
  const auto failed = [&](const std::string& why) {
    return std::runtime_error("cannot write " + file.string() + ": " + why);
  };
  int code = 0;
  zip_t* zip = zip_open(file.c_str(), ZIP_CREATE | ZIP_TRUNCATE, &code);  // written at close
  if (zip == nullptr) throw failed("the file cannot be created in its folder");
  const auto discard = [&] {
    const std::string why = zip_strerror(zip);
    zip_discard(zip);
    return failed(why);
  };
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const auto& from : files) {
    zip_source_t* source = zip_source_file(zip, from.c_str(), 0, -1);
    const zip_int64_t number =
        source == nullptr ? -1 : zip_file_add(zip, from.filename().c_str(), source, ZIP_FL_ENC_UTF_8);
    if (number < 0) {
      zip_source_free(source);
      throw discard();
    }
    if (const std::string extension = extension_of(from); extension == ".jpg" || extension == ".png")
      zip_set_file_compression(zip, static_cast<zip_uint64_t>(number), ZIP_CM_STORE, 0);
  }
  if (zip_close(zip) != 0) throw discard();
}

}  // namespace cairn
