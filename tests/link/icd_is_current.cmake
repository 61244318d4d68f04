# Whether the document in the tree is what the program prints.
execute_process(COMMAND ${PROGRAM} icd OUTPUT_VARIABLE printed COMMAND_ERROR_IS_FATAL ANY)
file(READ ${DOCUMENT} kept)
if(NOT printed STREQUAL kept)
  message(FATAL_ERROR "${DOCUMENT} is not what the tables say: boresight icd > ${DOCUMENT}")
endif()
