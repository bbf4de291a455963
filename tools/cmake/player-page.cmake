# Makes OUTPUT, an array of C that holds the page of the player, of the files in the folder PLAYER:
# page.html with the style sheet and the scripts in it. usage: cmake -DPLAYER= -DOUTPUT= -P THIS
cmake_minimum_required(VERSION 3.21)
file(READ ${PLAYER}/page.html page)
file(READ ${PLAYER}/style.css style)
foreach(name recording drawn camera solids picture energies player)
  file(READ ${PLAYER}/${name}.js text)
  string(APPEND script "${text}")
endforeach()
string(REPLACE "@style@" "${style}" page "${page}")
string(REPLACE "@script@" "${script}" page "${page}")
file(WRITE ${OUTPUT}.html "${page}")

file(READ ${OUTPUT}.html bytes HEX)
string(REGEX REPLACE "(................................)" "\\1\n" bytes "${bytes}")
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${bytes}")
file(WRITE ${OUTPUT} "#include \"record/player_page.h\"

const unsigned char ms_player_page[] = {
${bytes}};
const size_t ms_player_page_length = sizeof ms_player_page;
")
