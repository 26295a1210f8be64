// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "apps/cli/old_names.hpp"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace cairn::apps {
namespace {

using Words = std::vector<std::string>;

TEST(OldNames, OfCommandsOptionsAndValuesAreReplaced) {
  EXPECT_EQ(with_current_names({"optimise", "plan"}), (Words{"optimize", "plan"}));
  EXPECT_EQ(with_current_names({"graph", "optimise", "a.g2o"}), (Words{"graph", "optimize", "a.g2o"}));
  EXPECT_EQ(with_current_names({"synth", "room", "--colour-delay", "0.1", "--metres=30"}),
            (Words{"synth", "room", "--color-delay", "0.1", "--meters=30"}));
  EXPECT_EQ(with_current_names({"export", "m", "--compress", "quantised"}),
            (Words{"export", "m", "--compress", "quantized"}));
  EXPECT_EQ(with_current_names({"export", "m", "--compress=quantised"}),
            (Words{"export", "m", "--compress=quantized"}));
}

TEST(OldNames, OfFilesStay) {
  EXPECT_EQ(with_current_names({"info", "optimise"}), (Words{"info", "optimise"}));
  EXPECT_EQ(with_current_names({"export", "quantised"}), (Words{"export", "quantised"}));
  EXPECT_EQ(with_current_names({"info", "--", "--colour"}), (Words{"info", "--", "--colour"}));
}

TEST(OldNames, OfFieldsStayBesideTheCurrentNames) {
  nlohmann::json json{{"path", {{"meters", 2}}}, {"list", {{{"with_color", true}}}}};
  add_old_fields(json);
  EXPECT_EQ(json["path"], (nlohmann::json{{"meters", 2}, {"metres", 2}}));
  EXPECT_EQ(json["list"][0], (nlohmann::json{{"with_color", true}, {"with_colour", true}}));
}

}  // namespace
}  // namespace cairn::apps
