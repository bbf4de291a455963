# Marks plain comments as documentation: that at the top of a file, those before a declaration, and
# those behind a member.
1s#^/\* #/** \\file\n * #
s#^/\* #/** #
s#([;,{}0-9A-Za-z_]) +/\* #\1 /**< #
