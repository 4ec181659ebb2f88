/// @file
/// Exceptions of the host rooms. Core never throws.
#pragma once

#include <stdexcept>
#include <string>

namespace heft {

/// Base of everything heft throws on the host. The message says where, what was found, what was
/// expected and what to do. It is one line: control characters, which names in a file can hold, become '?'.
class Error : public std::runtime_error {
 public:
  explicit Error(const std::string& message);
};

/// Bad input file or value (exit code 3 of the command).
class InputError : public Error {
 public:
  using Error::Error;
};

/// A URDF that cannot be used.
class UrdfError : public InputError {
 public:
  using InputError::InputError;
};

/// A log that cannot be used.
class DataError : public InputError {
 public:
  using InputError::InputError;
};

/// A model or scenario file that cannot be used.
class ModelError : public InputError {
 public:
  using InputError::InputError;
};

/// The data cannot answer the question (exit code 4): says which parameters and what motion is missing.
class NotIdentifiableError : public Error {
 public:
  using Error::Error;
};

}  // namespace heft
