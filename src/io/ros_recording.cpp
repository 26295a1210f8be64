// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include "io/ros_recording.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <stdexcept>
#include <string_view>

#include "base/read_whole.hpp"
#include "base/words.hpp"
#include "cairn/file_name.hpp"
#include "cairn/source.hpp"
#include "io/part.hpp"
#include "io/zip_recording.hpp"

namespace cairn {
namespace {

namespace fs = std::filesystem;

/// The files of a folder of rosbag2, one after another.
class Rosbag2Folder final : public RosRecording {
 public:
  Rosbag2Folder(const fs::path& folder, std::vector<std::unique_ptr<RosRecording>> files)
      : RosRecording(folder.string(), "rosbag2 folder"), files_(std::move(files)), numbers_(files_.size()) {
    for (std::size_t i = 0; i < files_.size(); ++i) {
      take_topics(i);
      for (std::size_t t = 0; t < files_[i]->topics().size(); ++t)
        if (const auto& messages = files_[i]->topics()[t].messages) count(numbers_[i][t], *messages);
    }
  }

  std::optional<RosMessage> next() override {
    for (; at_ < files_.size(); ++at_) {
      if (auto message = files_[at_]->next()) {
        take_topics(at_);
        message->topic = numbers_[at_][message->topic];
        return message;
      }
      if (!ended_early_) ended_early_ = files_[at_]->ended_early();
    }
    return std::nullopt;
  }
  void rewind() override {
    for (const auto& file : files_) file->rewind();
    at_ = 0;
    ended_early_.reset();
  }

 private:
  /// Numbers the topics of a file that are not numbered yet.
  void take_topics(std::size_t file) {
    const auto& topics = files_[file]->topics();
    for (auto& numbers = numbers_[file]; numbers.size() < topics.size();) {
      const RosTopic& topic = topics[numbers.size()];
      numbers.push_back(topic_of(topic.name, topic.type, topic.encoding));
    }
  }

  std::vector<std::unique_ptr<RosRecording>> files_;
  std::vector<std::vector<std::size_t>> numbers_;  // by file and its topic
  std::size_t at_ = 0;
};

}  // namespace

std::size_t RosRecording::topic_of(std::string name, std::string type, RosEncoding encoding) {
  // What ROS itself allows in names is a part of this; they are told in messages.
  for (char& c : name)
    if (c < ' ' || c > '~' || c == '\'' || c == '`') c = '?';
  if (const std::size_t at = type.find("/msg/"); at != type.npos) type.erase(at, 4);
  const auto [it, is_new] = by_name_.try_emplace(name, topics_.size());
  if (is_new) topics_.push_back({.name = name, .type = std::move(type), .encoding = encoding, .messages = {}});
  return it->second;
}

void RosRecording::count(std::size_t topic, std::uint64_t messages) {
  topics_[topic].messages = topics_[topic].messages.value_or(0) + messages;
}

std::optional<RosMessage> ChunkedRecording::next() {
  for (;;) {
    try {
      std::optional<RosMessage> message;
      if (!chunk_left_.empty())
        message = message_in_chunk();
      else if (!read_record(message))
        return std::nullopt;
      if (message) return message;
    } catch (const std::runtime_error& error) {
      chunk_left_ = {};
      throw std::runtime_error(fmt::format("{}: the record at byte {}: {}", name(), record_at_, error.what()));
    }
  }
}

std::unique_ptr<RosRecording> open_rosbag2_folder(const fs::path& folder) {
  const fs::path about = folder / "metadata.yaml";
  std::vector<std::string> names;
  std::string packing;
  try {
    const YAML::Node all = YAML::LoadFile(about.string());
    const YAML::Node told = all["rosbag2_bagfile_information"];
    if (!told.IsMap()) throw std::runtime_error("tells no `rosbag2_bagfile_information`");
    if (!told["relative_file_paths"].IsSequence()) throw std::runtime_error("tells no `relative_file_paths`");
    for (const auto& name : told["relative_file_paths"]) names.push_back(name.as<std::string>());
    if (const auto mode = told["compression_mode"]; mode && mode.IsScalar()) packing = mode.as<std::string>();
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(fmt::format("{}: line {}: {}", about.string(), error.mark.line + 1, shown(error.msg)));
  } catch (const std::runtime_error& error) {
    throw std::runtime_error(fmt::format("{}: {}; `ros2 bag reindex` writes it again", about.string(), error.what()));
  }
  if (names.empty()) throw std::runtime_error(about.string() + ": names no file of the recording");
  std::vector<std::unique_ptr<RosRecording>> files;
  for (const std::string& name : names) {
    // Older versions wrote them with the folder's name.
    fs::path file = folder / name;
    std::error_code ignored;
    if (!fs::exists(file, ignored)) file = folder / fs::path(name).filename();
    if (const std::string extension = extension_of(file);
        packing == "FILE" || extension == ".zstd" || extension == ".zst")
      throw std::runtime_error(
          fmt::format("{}: is packed as a whole file; unpack it with `zstd -d`, take .zstd from "
                      "its name and `compression_mode: FILE` from {}",
                      file.string(), about.string()));
    files.push_back(open_ros_recording(file));
  }
  return std::make_unique<Rosbag2Folder>(folder, std::move(files));
}

std::unique_ptr<RosRecording> open_ros_recording(const fs::path& name) {
  std::error_code ignored;
  if (fs::is_directory(name, ignored)) return open_rosbag2_folder(name);
  const std::string extension = extension_of(name);
  if (extension == ".mcap") return open_mcap(name);
  if (extension == ".db3") return open_rosbag2_db3(name);
  return open_ros1_bag(name);
}

bool is_ros_recording(const std::string& name) {
  if (const auto part = part_in(name)) return is_ros_recording(part->recording);
  if (is_zip(name)) return is_ros_recording(unpacked(name)->recording());
  std::error_code ignored;
  if (!fs::is_directory(name, ignored)) {
    const std::string extension = extension_of(name);
    return extension == ".bag" || extension == ".mcap" || extension == ".db3";
  }
  // Others have files of this name, too.
  const fs::path about = fs::path(name) / "metadata.yaml";
  if (!fs::is_regular_file(about, ignored)) return false;
  const auto bytes = read_whole(about);
  return std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size())
             .find("rosbag2_bagfile_information") != std::string_view::npos;
}

}  // namespace cairn
