#include "msim/msim.h"

#define STRING_(x) #x
#define STRING(x)  STRING_(x)

const char *msim_version(void) {
  return STRING(MSIM_VERSION_MAJOR) "." STRING(MSIM_VERSION_MINOR) "." STRING(MSIM_VERSION_PATCH);
}
