/* suggest - the name that a user probably meant by an unknown one */
#ifndef MS_SUGGEST_H
#define MS_SUGGEST_H

#include "base/error.h"

/* List of words: the i-th one, NULL past the end. */
typedef const char *ms_word_list(int32_t i, const void *data);

/* The word in the list that was probably meant: that for which other systems say `word`, else one
 * that begins with it, else the most similar one. NULL: none. */
const char *ms_suggest_word(const char *word, ms_word_list *words, const void *data);

/* " (did you mean 'cholmod'?)", or "" without such a word. */
typedef struct ms_hint {
  char text[96];
} ms_hint;
ms_hint ms_suggest_hint(const char *word, ms_word_list *words, const void *data);

#endif
