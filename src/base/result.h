#pragma once

#include <cassert>
#include <string>
#include <utility>
#include <variant>

namespace loopd {

/// Why something at an edge (device, file, config, socket) failed: one sentence that says what was
/// tried, on what, and why it failed, and the errno behind it (0 if none).
struct Error {
  std::string message;
  int code = 0;
};

/// A value or an Error. Check before use: value() of an error is a broken invariant.
template <class T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }
  T& value() & {
    assert(ok());
    return std::get<0>(state_);
  }
  const T& value() const& {
    assert(ok());
    return std::get<0>(state_);
  }
  T&& value() && {
    assert(ok());
    return std::get<0>(std::move(state_));
  }
  T* operator->() { return &value(); }
  T& operator*() & { return value(); }
  const Error& error() const {
    assert(!ok());
    return std::get<1>(state_);
  }

 private:
  std::variant<T, Error> state_;
};

/// Success without a value.
struct Nothing {};
using Status = Result<Nothing>;

/// "message: strerror(code)" as an Error.
Error errno_error(const std::string& message, int code);

}  // namespace loopd
