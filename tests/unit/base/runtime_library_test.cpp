// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/runtime_library.hpp"

#include <gtest/gtest.h>

#include <array>

#include "support/files.hpp"

namespace cairn {
namespace {

const LibraryErrors kErrors{.need = "cosines need mathematics", .install = "learn it", .update = "learn more"};

TEST(RuntimeLibrary, FindsFunctionsInTheFirstFileThatExists) {
  const std::array<std::string, 2> files{"libcairn-missing.so", "libm.so.6"};
  double (*cosine)(double) = nullptr;
  RuntimeLibrary(files, kErrors).find("cos", cosine);
  ASSERT_NE(cosine, nullptr);
  EXPECT_EQ(cosine(0), 1);
}

TEST(RuntimeLibrary, ErrorsNameTheRemedy) {
  const std::array<std::string, 2> missing{"libcairn-missing.so", "libcairn-missing.so.1"};
  const std::array<std::string, 1> present{"libm.so.6"};
  EXPECT_EQ(error_of([&] { (void)RuntimeLibrary(missing, kErrors); }),
            "cosines need mathematics, whose libcairn-missing.so is not installed: learn it");
  void (*function)() = nullptr;
  EXPECT_EQ(error_of([&] { RuntimeLibrary(present, kErrors).find("cairn_cosine", function); }),
            "cosines need mathematics, and the installed version lacks cairn_cosine: learn more");
  const TemporaryFolder folder;
  write_text(folder / "broken.so", "not a library");
  const std::array<std::string, 1> broken{(folder / "broken.so").string()};
  EXPECT_NE(error_of([&] { (void)RuntimeLibrary(broken, kErrors); }).find("which cannot be loaded: "),
            std::string::npos);
}

}  // namespace
}  // namespace cairn
