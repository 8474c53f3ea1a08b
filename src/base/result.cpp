#include "base/result.h"

#include <system_error>

namespace loopd {

Error errno_error(const std::string& message, int code) {
  return {message + ": " + std::generic_category().message(code), code};
}

}  // namespace loopd
