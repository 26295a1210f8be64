// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
// Topics of a running ROS 2 graph as a recording: the messages of the first seconds are kept for the survey of its
// topics, and then played first.
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdlib>
#include <deque>
#include <set>
#include <stdexcept>
#include <string_view>
#include <thread>

#include "base/words.hpp"
#include "cairn/io/source.hpp"
#include "io/ros/dds.hpp"
#include "io/ros/ros2_types.hpp"
#include "io/ros/ros_recording.hpp"

namespace cairn {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
constexpr auto kMaxDiscovery = 5s;                   // until the first image
constexpr auto kListingTime = 1s;                    // of discovery, for a list of topics
constexpr auto kSurvey = 2s;                         // after the first image
constexpr auto kPoll = 100ms;                        // between looks at the publications
constexpr auto kTimeout = 2s;                        // without a depth image, until its publisher counts as gone
constexpr auto kReportInterval = 1s;                 // of a publisher that is gone
constexpr std::size_t kMaxKept = 512 << 20;          // bytes of messages kept for the survey
constexpr int kImagesKept = 10, kOthersKept = 1000;  // messages of a topic, until they are read
constexpr std::uint32_t kMaxDomain = 232;            // RTPS: higher domains have no ports

bool is_compressed(const DdsPublication& publication) { return publication.type == "sensor_msgs/CompressedImage"; }
bool is_image(const DdsPublication& publication) {
  return publication.type == "sensor_msgs/Image" || is_compressed(publication);
}
bool is_of_a_camera(const DdsPublication& publication) {
  return is_image(publication) || publication.type == "sensor_msgs/CameraInfo" ||
         publication.type == "sensor_msgs/Imu" || publication.type == "tf2_msgs/TFMessage";
}

std::uint32_t domain_in(std::string_view text, std::string_view origin) {
  const auto domain = number_in<std::uint32_t>(text);
  if (!domain || *domain > kMaxDomain)
    throw std::runtime_error(
        fmt::format("{}: the domain '{}' is not a number from 0 to {}", origin, shown(text), kMaxDomain));
  return *domain;
}

/// QoS that every publisher of a topic can serve.
DdsReaderOptions options_for(const std::vector<DdsPublication>& publications, const DdsPublication& topic) {
  DdsReaderOptions options{
      .reliable = true, .transient_local = true, .depth = is_image(topic) ? kImagesKept : kOthersKept};
  for (const DdsPublication& publication : publications) {
    if (publication.topic != topic.topic || publication.type != topic.type) continue;
    options.reliable &= publication.reliable;
    options.transient_local &= publication.transient_local;
  }
  return options;
}

class Ros2Graph final : public RosRecording {
 public:
  Ros2Graph(std::uint32_t domain, std::optional<std::vector<std::string>> compressed)
      : RosRecording(fmt::format("{}{}", kRos2, domain), "ROS 2 topics"),
        compressed_(std::move(compressed)),
        participant_(domain) {
    wait_for_images(domain);
  }

  bool is_live() const override { return true; }

  std::optional<RosMessage> next() override {
    if (is_replaying_) {
      if (replayed_ < kept_.size()) return message_in(kept_[replayed_++]);
      is_replaying_ = false;
      kept_.clear();
    }
    for (;;) {
      if (!pending_.empty()) return next_pending();
      if (is_survey() && (Clock::now() > survey_end_ || kept_bytes_ > kMaxKept)) return std::nullopt;
      if (!is_survey()) report_silence();
      receive();
    }
  }

  /// Plays the kept messages again.
  void rewind() override {
    is_replaying_ = !kept_.empty();
    replayed_ = 0;
  }

  void follow(const std::vector<std::size_t>& topics) override {
    for (const Subscription& subscription : subscriptions_)
      if (std::find(topics.begin(), topics.end(), subscription.topic) == topics.end())
        participant_.remove_reader(subscription.reader);
    std::erase_if(subscriptions_, [&](const Subscription& s) {
      return std::find(topics.begin(), topics.end(), s.topic) == topics.end();
    });
    depth_ = topics.front();
    heard_ = Clock::now();
  }

 private:
  struct Subscription {
    std::size_t topic;
    DdsPublication publication;
    DdsReaderOptions options;
    DdsParticipant::Entity reader;
  };
  struct Received {
    std::size_t topic;
    std::uint64_t number;  // counts the topic's messages
    DdsMessage message;
  };

  [[nodiscard]] bool is_survey() const { return !depth_; }

  RosMessage message_in(const Received& received) const {
    return {received.topic,  1e-9 * static_cast<double>(received.message.sent),
            received.number, received.message.bytes,
            &name(),         "message"};
  }

  RosMessage next_pending() {
    Received first = std::move(pending_.front());
    pending_.pop_front();
    if (is_survey()) {
      kept_bytes_ += first.message.bytes.size();
      return message_in(kept_.emplace_back(std::move(first)));
    }
    current_ = std::move(first);
    return message_in(current_);
  }

  /// Waits for messages, and adds them in the order in which they were sent.
  void receive() {
    if (is_survey()) subscribe();
    participant_.wait(kPoll);
    for (const Subscription& subscription : subscriptions_)
      for (DdsMessage& message : participant_.take(subscription.reader)) {
        if (depth_ == subscription.topic) hear();
        numbers_.resize(topics().size());
        pending_.push_back({subscription.topic, ++numbers_[subscription.topic], std::move(message)});
      }
    std::stable_sort(pending_.begin(), pending_.end(),
                     [](const Received& a, const Received& b) { return a.message.sent < b.message.sent; });
  }

  /// Subscribes to the camera topics that were announced since the last call.
  void subscribe() {
    const auto publications = participant_.publications();
    for (const DdsPublication& publication : publications) {
      const bool is_known = std::any_of(subscriptions_.begin(), subscriptions_.end(), [&](const Subscription& s) {
        return s.publication.topic == publication.topic;
      });
      if (is_known || !is_of_a_camera(publication) || is_redundant(publication, publications)) continue;
      const DdsReaderOptions options = options_for(publications, publication);
      subscriptions_.push_back({topic_of(publication.topic, publication.type, RosEncoding::cdr), publication, options,
                                participant_.add_reader(publication.topic, publication.type, options)});
    }
  }

  /// True for a compressed topic of a raw image topic that is published too. Reading it would make its publisher
  /// compress.
  [[nodiscard]] bool is_redundant(const DdsPublication& publication,
                                  const std::vector<DdsPublication>& publications) const {
    if (!is_compressed(publication) || !compressed_) return false;
    if (std::find(compressed_->begin(), compressed_->end(), publication.topic) != compressed_->end()) return false;
    return std::any_of(publications.begin(), publications.end(), [&](const DdsPublication& raw) {
      return raw.type == "sensor_msgs/Image" && publication.topic.starts_with(raw.topic + "/");
    });
  }

  /// Reads until an image has arrived. Throws std::runtime_error with the image topics after kMaxDiscovery.
  void wait_for_images(std::uint32_t domain) {
    const auto has_image = [&] {
      return std::any_of(pending_.begin(), pending_.end(), [&](const Received& r) {
        return topics()[r.topic].type == "sensor_msgs/Image" || topics()[r.topic].type == "sensor_msgs/CompressedImage";
      });
    };
    const auto end = Clock::now() + kMaxDiscovery;
    while (!has_image()) {
      if (Clock::now() > end) throw std::runtime_error(no_images(domain));
      receive();
    }
    survey_end_ = Clock::now() + kSurvey;
  }

  [[nodiscard]] std::string no_images(std::uint32_t domain) const {
    std::set<std::string> silent;
    for (const Subscription& s : subscriptions_)
      if (is_image(s.publication)) silent.insert(shown(s.publication.topic));
    if (!silent.empty())
      return fmt::format("{}: no image arrived within {} s; silent topics: {}", name(), kMaxDiscovery.count(),
                         fmt::join(silent, ", "));
    return fmt::format(
        "{}: no image topic is published in domain {}; start the camera's node, and check ROS_DOMAIN_ID, the network "
        "and CYCLONEDDS_URI",
        name(), domain);
  }

  void hear() {
    if (is_silent_) spdlog::warn("{}: {} is published again", name(), topics()[*depth_].name);
    is_silent_ = false;
    heard_ = Clock::now();
  }

  /// Throws std::runtime_error each second without depth images.
  void report_silence() {
    const auto now = Clock::now();
    if (now < heard_ + kTimeout || (is_silent_ && now < reported_ + kReportInterval)) return;
    const std::string& topic = topics()[*depth_].name;
    if (!is_silent_)
      spdlog::warn("{}: no image of {} for two seconds; the run continues when it is published again", name(), topic);
    is_silent_ = true;
    reported_ = now;
    renew();
    throw std::runtime_error(fmt::format("{}: {} is not published", name(), topic));
  }

  /// Subscribes again to topics that are now published with other QoS.
  void renew() {
    const auto publications = participant_.publications();
    for (Subscription& s : subscriptions_) {
      const DdsReaderOptions options = options_for(publications, s.publication);
      const bool is_published = std::any_of(publications.begin(), publications.end(),
                                            [&](const DdsPublication& p) { return p.topic == s.publication.topic; });
      const bool is_served =
          options.reliable >= s.options.reliable && options.transient_local >= s.options.transient_local;
      if (!is_published || is_served) continue;
      participant_.remove_reader(s.reader);
      s.options = options;
      s.reader = participant_.add_reader(s.publication.topic, s.publication.type, options);
    }
  }

  std::optional<std::vector<std::string>> compressed_;
  DdsParticipant participant_;
  std::vector<Subscription> subscriptions_;
  std::vector<std::uint64_t> numbers_;  // of the topics' last messages
  std::deque<Received> pending_, kept_;
  Received current_{};
  std::size_t kept_bytes_ = 0, replayed_ = 0;
  bool is_replaying_ = false, is_silent_ = false;
  std::optional<std::size_t> depth_;  // empty: survey
  Clock::time_point survey_end_, heard_, reported_;
};

}  // namespace

std::uint32_t ros2_domain(std::string_view name) {
  if (!name.starts_with(kRos2)) throw std::runtime_error(fmt::format("{}: is not ros2: or ros2:DOMAIN", shown(name)));
  if (name.size() > kRos2.size()) return domain_in(name.substr(kRos2.size()), kRos2);
  const char* variable = std::getenv("ROS_DOMAIN_ID");
  return variable == nullptr || *variable == 0 ? 0 : domain_in(variable, "ROS_DOMAIN_ID");
}

std::unique_ptr<RosRecording> open_ros2(std::string_view name, std::optional<std::vector<std::string>> compressed) {
  return std::make_unique<Ros2Graph>(ros2_domain(name), std::move(compressed));
}

std::vector<std::string> ros2_depth_topics() {
  {
    const DdsParticipant participant(ros2_domain(kRos2));
    const auto has_image = [&] {
      const auto all = participant.publications();
      return std::any_of(all.begin(), all.end(), is_image);
    };
    const auto end = Clock::now() + kListingTime;
    while (!has_image()) {
      if (Clock::now() > end) return {};
      std::this_thread::sleep_for(kPoll);
    }
  }
  std::vector<std::string> topics;
  for (const RecordedTopic& topic : recorded_topics(std::string(kRos2)))
    if (topic.holds == RecordedTopic::Holds::depth) topics.push_back(topic.name);
  return topics;
}

}  // namespace cairn
