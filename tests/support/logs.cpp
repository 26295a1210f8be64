// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "support/logs.hpp"

#include <cstdlib>

#include "support/files.hpp"

namespace cairn {

nlohmann::json read_log(const std::filesystem::path& file) {
  const std::string support = (source_folder() / "tests/support").string();
  EXPECT_TRUE(std::filesystem::exists(support + "/node_modules/@mcap/core")) << "run npm ci --prefix tests/support";
  const TemporaryFolder folder;
  const std::string out = (folder / "out").string();
  EXPECT_EQ(std::system(("node '" + support + "/read_mcap.mjs' '" + file.string() + "' >'" + out + "' 2>&1").c_str()),
            0)
      << read_bytes(out);
  return nlohmann::json::parse(read_bytes(out), nullptr, false);
}

}  // namespace cairn
