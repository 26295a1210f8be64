// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "base/read_json.hpp"

#include <gtest/gtest.h>

#include "base/json_text.hpp"
#include "support/crafted.hpp"
#include "support/files.hpp"

namespace cairn {
namespace {

TEST(ReadJson, RejectsDeepNesting) {
  EXPECT_NO_THROW((void)parsed_json(nested(kMaxJsonDepth)));
  EXPECT_EQ(error_of([] { (void)parsed_json(nested(kMaxJsonDepth + 1)); }),
            "its JSON is nested deeper than 64 levels at byte 64");
  std::string objects;
  for (int i = 0; i < kDeep; ++i) objects += R"({"a":)";
  EXPECT_THROW((void)parsed_json(objects), TooDeepJson);
  EXPECT_TRUE(parsed_json_or_none(nested()).is_discarded());
  EXPECT_TRUE(parsed_json_or_none("{").is_discarded());
}

TEST(ReadJson, IgnoresBracketsInStrings) {
  const std::string brackets = "\"" + std::string(1000, '[') + R"(\"[[\\")";
  EXPECT_EQ(parsed_json("[" + brackets + "]").at(0).get<std::string>().size(), 1000u + 4);
  EXPECT_NO_THROW((void)parsed_json("[[],[],[" + std::string(2000, ' ') + "]]"));
  std::string wide = "[0";
  for (int i = 0; i < 1000; ++i) wide += ",[{}]";
  EXPECT_EQ(parsed_json(wide + "]").size(), 1001u);
}

TEST(ReadJson, MessageHasNoBytesOfText) {
  try {
    (void)parsed_json("{\"a\": \x1b[2J\xff}");
    FAIL() << "is no JSON";
  } catch (const nlohmann::json::exception& error) {
    const std::string message = plain(error.what());
    EXPECT_EQ(message.find('\x1b'), std::string::npos) << message;
    EXPECT_NE(message.find("parse error at line 1, column 7"), std::string::npos) << message;
  }
}

TEST(ReadJson, RejectsDeeplyNestedCbor) {
  EXPECT_THROW((void)parsed_cbor(std::string(kDeep, '\x81')), std::runtime_error);
  EXPECT_THROW((void)parsed_cbor(std::string(kDeep, '\x9f')), std::runtime_error);
  EXPECT_EQ(parsed_cbor("\x81\x01").at(0), 1);
}

}  // namespace
}  // namespace cairn
