# Installs the command, and man pages and completion scripts that it writes of itself.
install(TARGETS heft RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR} COMPONENT command)
set(texts ${CMAKE_CURRENT_BINARY_DIR}/texts)
file(STRINGS heft/commands.cpp lines REGEX "^ +{\"[a-z-]+\", *(\"|$)")
set(pages heft)
foreach(line IN LISTS lines)
  string(REGEX REPLACE "^ +{\"([a-z-]+)\".*" "\\1" command "${line}")
  list(APPEND pages heft-${command})
endforeach()
set(runs "")
foreach(page IN LISTS pages)
  string(REGEX REPLACE "^heft-?" "" command "${page}")
  list(APPEND runs COMMAND $<TARGET_FILE:heft> --man ${command} > ${texts}/${page}.1)
endforeach()
add_custom_command(OUTPUT ${texts}/written
  COMMAND ${CMAKE_COMMAND} -E make_directory ${texts}
  ${runs}
  COMMAND $<TARGET_FILE:heft> --completion bash > ${texts}/heft
  COMMAND $<TARGET_FILE:heft> --completion zsh > ${texts}/_heft
  COMMAND ${CMAKE_COMMAND} -E touch ${texts}/written
  DEPENDS heft COMMENT "Writing man pages and completion scripts" VERBATIM)
add_custom_target(heft_texts ALL DEPENDS ${texts}/written)
list(TRANSFORM pages APPEND .1 OUTPUT_VARIABLE files)
list(TRANSFORM files PREPEND ${texts}/)
install(FILES ${files} DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT command)
install(FILES ${texts}/heft DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT command)
install(FILES ${texts}/_heft DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT command)
