// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Zipped recordings.
#include "fuzz.hpp"
#include "io/datasets/zip_recording.hpp"

using namespace cairn;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto archive = fuzz::file_of("a.zip", fuzz::text_of(data, size));
  const auto previous = std::filesystem::temp_directory_path();
  setenv("TMPDIR", fuzz::folder().c_str(), 1);  // destination of the unpacking
  fuzz::expect_value_or_plain_error([&] {
    const UnpackedZip zip(archive);
    if (!std::filesystem::exists(zip.recording())) std::abort();
  });
  setenv("TMPDIR", previous.c_str(), 1);
  // The unpacked folder is removed, and no file was written outside of it.
  for (const auto& entry : std::filesystem::directory_iterator(fuzz::folder()))
    if (entry.path().filename() != "a.zip") std::abort();
  return 0;
}
