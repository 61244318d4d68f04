# What `cmake --install` puts where: the program, libboresight with its headers, pkg-config file and
# CMake package, scenarios, documentation. Everything finds its neighbours relative to itself, so an
# installed tree can be moved.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)

# libboresight: all parts, the list of modules and the commands in one shared library, so that a C program links it
# with nothing else: the C++ run time and the libraries below come with it. Visible is what
# include/boresight declares.
# Sanitized and fuzzed builds are for this tree's own tests and have none.
if(NOT BORESIGHT_SANITIZE AND NOT BORESIGHT_FUZZ)
  set(BST_VISIBLE ${PROJECT_SOURCE_DIR}/cmake/libboresight.map)
  set(parts bst_core bst_fft bst_messages bst_dynamics bst_astro bst_device bst_catalogue bst_optics bst_world
    bst_onboard bst_io bst_link bst_engine bst_eval bst_scenegen bst_gimbal
    bst_imgproc bst_tracker bst_control bst_obsgen bst_scenario_registry bst_api bst_studies bst_cli
    bst_run bst_analysis bst_export bst_report bst_study_kinds bst_commands)
  # all objects of each part, not only what others call; the archives then add nothing but what the
  # parts themselves link
  list(TRANSFORM parts REPLACE ".+" "$<TARGET_OBJECTS:\\0>" OUTPUT_VARIABLE objects)
  add_library(libboresight SHARED ${objects})
  target_link_libraries(libboresight PRIVATE ${parts})
  set_target_properties(libboresight PROPERTIES
    OUTPUT_NAME boresight
    EXPORT_NAME boresight
    VERSION ${PROJECT_VERSION}
    SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
    LINKER_LANGUAGE CXX
    LINK_DEPENDS ${BST_VISIBLE})
  target_link_options(libboresight PRIVATE
    -Wl,--version-script=${BST_VISIBLE} -Wl,-Bsymbolic -Wl,-z,defs -Wl,--as-needed)
  target_include_directories(libboresight
    INTERFACE $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  # inline functions call the maths library
  target_link_libraries(libboresight INTERFACE m)

  install(TARGETS libboresight EXPORT boresight LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})

  install(DIRECTORY include/boresight DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})

  set(package ${CMAKE_INSTALL_LIBDIR}/cmake/boresight)
  configure_package_config_file(cmake/boresightConfig.cmake.in
    ${PROJECT_BINARY_DIR}/boresightConfig.cmake INSTALL_DESTINATION ${package})
  # before 1.0 a minor version may change interfaces
  write_basic_package_version_file(${PROJECT_BINARY_DIR}/boresightConfigVersion.cmake
    COMPATIBILITY SameMinorVersion)
  install(EXPORT boresight NAMESPACE boresight:: DESTINATION ${package}
    FILE boresightTargets.cmake)
  install(FILES ${PROJECT_BINARY_DIR}/boresightConfig.cmake
    ${PROJECT_BINARY_DIR}/boresightConfigVersion.cmake DESTINATION ${package})

  # the prefix as seen from the .pc file, or the configured one where folders lie outside of it
  set(BST_PC_FOLDER ${CMAKE_INSTALL_LIBDIR}/pkgconfig)
  if(IS_ABSOLUTE "${CMAKE_INSTALL_LIBDIR}" OR IS_ABSOLUTE "${CMAKE_INSTALL_INCLUDEDIR}")
    set(BST_PC_PREFIX ${CMAKE_INSTALL_PREFIX})
    set(BST_PC_LIBDIR ${CMAKE_INSTALL_FULL_LIBDIR})
    set(BST_PC_INCLUDEDIR ${CMAKE_INSTALL_FULL_INCLUDEDIR})
  else()
    file(RELATIVE_PATH up "/${BST_PC_FOLDER}" "/")
    string(REGEX REPLACE "/$" "" up "${up}")
    set(BST_PC_PREFIX "\${pcfiledir}/${up}")
    set(BST_PC_LIBDIR "\${prefix}/${CMAKE_INSTALL_LIBDIR}")
    set(BST_PC_INCLUDEDIR "\${prefix}/${CMAKE_INSTALL_INCLUDEDIR}")
  endif()
  configure_file(cmake/boresight.pc.in ${PROJECT_BINARY_DIR}/boresight.pc @ONLY)
  install(FILES ${PROJECT_BINARY_DIR}/boresight.pc DESTINATION ${BST_PC_FOLDER})
endif()

install(TARGETS boresight)
install(DIRECTORY scenarios DESTINATION ${CMAKE_INSTALL_DATADIR}/boresight)
install(DIRECTORY python/examples DESTINATION ${CMAKE_INSTALL_DATADIR}/boresight/python
  FILES_MATCHING PATTERN "*.py")
install(FILES LICENSE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
install(DIRECTORY docs DESTINATION ${CMAKE_INSTALL_DOCDIR}
  FILES_MATCHING PATTERN "*.md" PATTERN "*.png" PATTERN "*.c" PATTERN "*.ipynb"
  PATTERN "CMakeLists.txt")
# what `./dev docs` built, if it did
install(DIRECTORY ${PROJECT_BINARY_DIR}/docs/ DESTINATION ${CMAKE_INSTALL_DOCDIR}/html OPTIONAL)
install(FILES docs/boresight.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
install(FILES cmake/completions/boresight.bash RENAME boresight
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
install(FILES cmake/completions/_boresight DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
install(FILES cmake/boresight.desktop DESTINATION ${CMAKE_INSTALL_DATADIR}/applications)
install(FILES view/page/icon.svg RENAME boresight.svg
  DESTINATION ${CMAKE_INSTALL_DATADIR}/icons/hicolor/scalable/apps)
install(FILES cmake/completions/boresight.fish
  DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
