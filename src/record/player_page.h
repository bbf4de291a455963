/* player_page - the page of the player, which the build makes of src/record/player: all of a .html
 * trajectory that stands before its data */
#ifndef MS_PLAYER_PAGE_H
#define MS_PLAYER_PAGE_H

#include <stddef.h>

extern const unsigned char ms_player_page[];
extern const size_t ms_player_page_length;

#endif
