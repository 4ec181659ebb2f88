// See test/ros2/stub/README.md.
#pragma once

#include <memory>
#include <type_traits>

// A plugin is made without arguments and used through its base.
#define PLUGINLIB_EXPORT_CLASS(class_type, base_class_type)       \
  static_assert(std::is_base_of_v<base_class_type, class_type> && \
                std::is_default_constructible_v<class_type> && !std::is_abstract_v<class_type>);
