#include "base/error.h"

#include <assert.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

/* Replace control characters: text of files and plugins must not break the line of a message. */
static void replace_control_characters(char *text) {
  for (; *text; text++)
    if ((unsigned char)*text < ' ' || *text == 0x7f) *text = ' ';
}

static_assert(sizeof(msim_error) == 1024, "msim_error is fixed (api.h)");

/* Later versions may take these bytes for members. */
static void clear_reserved_bytes(msim_error *err) {
  memset(err->text + MS_ERROR_LENGTH, 0, sizeof err->text - MS_ERROR_LENGTH);
}

msim_status ms_error_vset(msim_error *err, msim_status status, const char *format, va_list args) {
  if (err) {
    err->status = status;
    vsnprintf(err->text, MS_ERROR_LENGTH, format, args);
    replace_control_characters(err->text);
    clear_reserved_bytes(err);
  }
  return status;
}

msim_status ms_error_set(msim_error *err, msim_status status, const char *format, ...) {
  va_list args;
  va_start(args, format);
  ms_error_vset(err, status, format, args);
  va_end(args);
  return status;
}

msim_status ms_error_set_memory(msim_error *err, const char *what) {
  return ms_error_set(err, MSIM_ERR_MEMORY, "out of memory for %s", what);
}

msim_status ms_error_io_status(int number) {
  return number == ENOMEM ? MSIM_ERR_MEMORY : MSIM_ERR_IO;
}

msim_status ms_error_clear(msim_error *err) {
  if (err) {
    err->status = MSIM_OK;
    err->text[0] = '\0';
    clear_reserved_bytes(err);
  }
  return MSIM_OK;
}

#define STATUS_CASE(name, value, text) \
  case name:                           \
    return text;

const char *msim_status_text(msim_status status) {
  switch (status) {
    MSIM_STATUS_LIST(STATUS_CASE)
    default:
      return "unknown status";
  }
}
