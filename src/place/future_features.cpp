// SPDX-License-Identifier: Apache-2.0
// SPDX-FileCopyrightText: The Cairn developers
#include <exception>
#include <utility>

#include "place/features.hpp"

namespace cairn {

FutureFeatures ready(Features features) {
  std::promise<std::shared_ptr<const Features>> promise;
  promise.set_value(std::make_shared<const Features>(std::move(features)));
  return promise.get_future().share();
}

std::shared_ptr<const Features> features_or_none(const FutureFeatures& features) {
  try {
    return features.get();
  } catch (const std::exception&) {  // reported by the owner of the extraction
    return std::make_shared<const Features>();
  }
}

}  // namespace cairn
