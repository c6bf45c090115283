"""The supervisor's and the participant's page, served by a process of their own.

From the bottom up::

    rights      who may see and ask what: one-time tokens, cookies, refusals
    board       what is known of the session, from its events
    live        machine and scenario signals, from LSL
    words       what pages say, in the participant's language
    desk        the session as pages see it, and how they ask
    form        a questionnaire on a page
    consent     the consent text on a page, before the session
    surroundings
                what stands around the machine
    scene       the machine in three dimensions
    pictures, cameras
                what the views' cameras show, from LSL
    loads       how hard the joints work
    participant_page, supervisor_page
    service     the process: one pipe to the launcher, and the web server
    keeper      the launcher's side: starts it, starts it again, passes on

Nothing here touches the loop: a page reads LSL and the launcher's events, and whatever it asks
goes through the launcher's pipe into the session.
"""
